"""trueangle: make cheap rotary encoders and robot joints tell the true angle."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ._core import __version__

if TYPE_CHECKING:
    from . import errors as errors
    from . import plots as plots
    from . import terms as terms
    from .angles import wrap as wrap
    from .checks import check as check
    from .diagnosis import Diagnosis as Diagnosis
    from .diagnosis.diagnose import diagnose as diagnose
    from .errors import TrueAngleError as TrueAngleError
    from .export import compare as compare
    from .export import export_model as export_model
    from .export import import_model as import_model
    from .fitting.fit import fit as fit
    from .fitting.result import FitResult as FitResult
    from .joining import join as join
    from .logs.batch import correct_logs as correct_logs
    from .logs.fitting import fit_logs as fit_logs
    from .logs.frames import correct as correct
    from .model import HarmonicModel as HarmonicModel
    from .modelfile import load_model as load_model
    from .moments import Moments as Moments
    from .orders.select import OrderSelection as OrderSelection
    from .orders.select import select_orders as select_orders
    from .planning.plan import plan_mounts as plan_mounts
    from .rehearsal import Rehearsal as Rehearsal
    from .rehearsal.rehearse import rehearse as rehearse
    from .reports import report as report
    from .runcsv import write_runs as write_runs
    from .runfiles import read_runs as read_runs
    from .runs import CalibrationRun as CalibrationRun
    from .selfcalibration import SelfCalibration as SelfCalibration
    from .selfcalibration import selfcal as selfcal
    from .shafts import Shaft as Shaft
    from .simulation import Simulation as Simulation
    from .simulation import load_simulation as load_simulation
    from .simulation import simulate as simulate
    from .terms import Backlash as Backlash
    from .terms import FilterLag as FilterLag
    from .terms import Latency as Latency
    from .terms import LoadDependentGearError as LoadDependentGearError
    from .terms import LocalDefect as LocalDefect
    from .terms import PreslidingHysteresis as PreslidingHysteresis
    from .terms import StiffeningCompliance as StiffeningCompliance
    from .terms import ThermalDrift as ThermalDrift
    from .terms import TorsionalCompliance as TorsionalCompliance

#: Public names and the modules that define them; a module is imported at first use.
_PUBLIC = {
    "TrueAngleError": "errors",
    "wrap": "angles",
    "CalibrationRun": "runs",
    "Diagnosis": "diagnosis",
    "OrderSelection": "orders",
    "plan_mounts": "planning",
    "select_orders": "orders",
    "FitResult": "fitting.result",
    "HarmonicModel": "model",
    "SelfCalibration": "selfcalibration",
    "Shaft": "shafts",
    "check": "checks",
    "correct": "logs.frames",
    "correct_logs": "logs.batch",
    "compare": "export",
    "export_model": "export",
    "import_model": "export",
    "join": "joining",
    "fit": "fitting.fit",
    "fit_logs": "logs.fitting",
    "load_model": "modelfile",
    "Moments": "moments",
    "read_runs": "runfiles",
    "Rehearsal": "rehearsal",
    "rehearse": "rehearsal",
    "report": "reports",
    "selfcal": "selfcalibration",
    "Simulation": "simulation",
    "diagnose": "diagnosis",
    "load_simulation": "simulation",
    "simulate": "simulation",
    "write_runs": "runcsv",
    **dict.fromkeys(
        (
            "Backlash",
            "FilterLag",
            "Latency",
            "LoadDependentGearError",
            "LocalDefect",
            "PreslidingHysteresis",
            "StiffeningCompliance",
            "ThermalDrift",
            "TorsionalCompliance",
        ),
        "terms",
    ),
}

#: Modules that are reached as attributes, likewise imported at first use.
_MODULES = ("errors", "plots", "terms")

__all__ = ["__version__", *sorted([*_PUBLIC, *_MODULES])]


def __getattr__(name: str) -> Any:
    if name in _MODULES:
        return importlib.import_module(f".{name}", __name__)
    module = _PUBLIC.get(name)
    if module is None:
        raise AttributeError(f"module 'trueangle' has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{module}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)  # what completion shows
