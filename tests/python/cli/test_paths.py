"""Names and import paths that documentation and changelog promise work."""

import importlib
import re
import sys

import pytest

import trueangle as ta
from conftest import ROOT
from trueangle.support import renamed

#: Rooms of the first release that the reference named, and what they held.
EARLIER = {
    "trueangle.simulation.effects": """
        EFFECTS Effect Surroundings
    """,
    "trueangle.terms": """
        TERMS Backlash FilterLag Latency LoadDependentGearError LocalDefect PreslidingHysteresis
        StiffeningCompliance Term ThermalDrift TorsionalCompliance
    """,
    "trueangle.plots": """
        amplitude_spectrum before_after error_curves error_left fit_plot gains
        measured_and_simulated phases_over_runs plan_factors plan_positions residuals
    """,
    "trueangle.planning": """
        HIGHEST_LOW_ORDER CalibrationPlan plan_encoder plan_mounts plan_tilts readings_needed
        wanted_orders
    """,
    "trueangle.fitting.heldout": """
        HeldOut HeldOutRun correct_held_out hold_out hold_out_extended
    """,
    "trueangle.errors": """
        ArgumentError FileError MissingExtraError MissingSignalError ModelFileError NoModelError
        NotInvertibleError OutsideSpanWarning RankError TrueAngleError
    """,
    "trueangle.reports": """
        Report demo_report report
    """,
    "trueangle.simulation": """
        EFFECTS ArgumentShift Backlash DriftWithinRun Effect FilterLag Harmonic
        HeteroscedasticNoise Joint Latency LoadDependentGearError LocalDefect MissedCounts
        MissingOrder NonIntegerOrder Outliers Pattern PreslidingHysteresis ReferenceLines
        RunDesign ScaleError Sidebands Signals Simulation StiffeningCompliance ThermalDrift
        TorsionalCompliance ZeroSlip join_runs load_simulation simulate
    """,
    "trueangle.diagnosis": """
        Diagnosis Finding diagnose
    """,
    "trueangle.orders": """
        FALSE_ALARM OrderRow OrderSelection select_orders
    """,
}


def resolved(path):
    """What a dotted path names; the longest part that is a module is imported."""
    parts = path.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:cut]))
        except ModuleNotFoundError as missing:
            if missing.name is None or not missing.name.startswith("trueangle"):
                pytest.skip(f"{missing.name} is not installed")
            continue
        for name in parts[cut:]:
            found = getattr(found, name)
        return found
    raise AssertionError(f"{path}: no such module")


def documented():
    """Everything that the reference lists, members that are named included."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        from reference_pages import BLOCK, entries
    finally:
        sys.path.pop(0)
    paths = []
    for page in sorted((ROOT / "docs" / "reference").glob("*.md")):
        for block in BLOCK.findall(page.read_text("utf-8")):
            for name, members in entries(block):
                paths.append(name)
                paths += [f"{name}.{member.strip()}" for member in members.split(",") if member]
    assert len(paths) > 50
    return paths


def told_in_changelog():
    text = (ROOT / "CHANGELOG.md").read_text("utf-8")
    paths = {
        path.rstrip(".")
        for quoted in re.findall(r"`([^`]+)`", text)
        for path in re.findall(r"(?<![\w/-])(?:ta|trueangle)(?:\.[A-Za-z_]\w*)+", quoted)
    }
    assert len(paths) > 15
    return sorted({re.sub(r"^ta\b", "trueangle", path) for path in paths})


@pytest.mark.parametrize("path", documented())
def test_the_reference_names_what_there_is(path):
    assert resolved(path) is not None


@pytest.mark.filterwarnings("ignore:trueangle.*is now:DeprecationWarning")
@pytest.mark.parametrize("path", told_in_changelog())
def test_the_changelog_names_what_there_is(path):
    assert resolved(path) is not None


@pytest.mark.filterwarnings("ignore:trueangle.*is now:DeprecationWarning")
@pytest.mark.parametrize(
    "path", [f"{room}.{name}" for room, names in EARLIER.items() for name in names.split()]
)
def test_paths_of_earlier_releases_stay(path):
    assert resolved(path) is not None


#: One module was a room before: what it held is found in the room.
ROOMS = {"trueangle.runs": "CalibrationRun", "trueangle.model": "HarmonicModel"}


@pytest.mark.parametrize("name", renamed.RENAMED)
def test_a_former_name_finds_the_module_and_says_so(name):
    now = importlib.import_module(f"trueangle.{renamed.RENAMED[name]}")
    sys.modules.pop(f"trueangle.{name}", None)
    with pytest.warns(DeprecationWarning, match=f"trueangle.{name} is now {now.__name__};"):
        before = importlib.import_module(f"trueangle.{name}")
    held = {key: value for key, value in vars(now).items() if not key.startswith("__")}
    assert held or hasattr(now, "__path__")
    assert all(getattr(before, key) is value for key, value in held.items())


@pytest.mark.parametrize("name", ROOMS)
def test_a_module_that_became_a_room_still_holds_its_names(name):
    with pytest.warns(DeprecationWarning, match=f"{name}.{ROOMS[name]} is now {name}"):
        assert getattr(importlib.import_module(name), ROOMS[name]) is getattr(ta, ROOMS[name])
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        _ = importlib.import_module(name).nothing


def test_a_room_under_its_former_name_holds_the_same_modules():
    assert renamed.moved_name("orders.select") == "fitting.orders.select"
    sys.modules.pop("trueangle.orders.select", None)
    with pytest.warns(DeprecationWarning, match="is now"):
        found = importlib.import_module("trueangle.orders.select")
    assert found.select_orders is ta.select_orders


def test_what_never_was_is_not_found():
    with pytest.raises(ModuleNotFoundError, match=r"trueangle\.nothing"):
        importlib.import_module("trueangle.nothing")
