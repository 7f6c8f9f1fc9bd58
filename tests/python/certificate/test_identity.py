"""Lines of a budget, limits and what is left out, as a file states them."""

import math
from dataclasses import replace

import numpy as np
import pytest

from trueangle.certificate.identity import _contribution, load_identity
from trueangle.errors import ArgumentError, FileError


def written(tmp_path, more):
    path = tmp_path / "identity.toml"
    path.write_text(f'[certificate]\nnumber = "1"\nitem = "joint"\n\n{more}\n')
    return load_identity(path)


@pytest.mark.parametrize("told", [None, 9, 0.5, float("inf")])
def test_a_line_of_a_file_has_the_freedom_that_it_says(told):
    entry = {"name": "table", "standard_arcsec": 2.0}
    if told is not None:
        entry["degrees_of_freedom"] = told
    freedom = _contribution(1, entry).degrees_of_freedom
    assert freedom == (math.inf if told is None else told)


@pytest.mark.parametrize("told", ["nine", 0, -1, float("nan"), True])
def test_a_freedom_that_is_none_is_refused(told):
    entry = {"name": "table", "standard_arcsec": 2.0, "degrees_of_freedom": told}
    with pytest.raises(ArgumentError, match=r"table.* degrees_of_freedom must"):
        _contribution(1, entry)


@pytest.mark.parametrize(("key", "told"), [("limit_arcsec", 36.0), ("limit_deg", 0.01)])
def test_a_limit_is_the_same_in_either_unit(key, told, tmp_path):
    found = written(tmp_path, f'[specification]\n{key} = {told}\ndecision_rule = "simple"\n')
    assert found.specification.limit_arcsec == pytest.approx(36.0)
    for wrong in (0.0, -told):
        with pytest.raises(FileError, match=rf"{key} must be positive, got {wrong}"):
            written(tmp_path, f'[specification]\n{key} = {wrong}\ndecision_rule = "simple"\n')


@pytest.mark.parametrize(
    ("distribution", "density"),
    [
        ("rectangular", lambda x: np.ones(x.size)),
        ("triangular", lambda x: 1.0 - np.abs(x)),
        ("arcsine", lambda x: 1.0 / np.sqrt(1.0 - x**2)),
        ("two-point", lambda x: 1.0 * (np.abs(x) > 0.9999)),
    ],
)
def test_a_half_width_has_the_standard_deviation_of_its_distribution(
    distribution, density, tmp_path
):
    """By the density's own second moment."""
    x = np.sin((np.arange(200_000) + 0.5) / 200_000 * np.pi - np.pi / 2.0)
    share = density(x) * np.sqrt(1.0 - x**2) if distribution != "two-point" else density(x)
    wanted = 6.0 * np.sqrt(share @ x**2 / share.sum())
    line = f'name = "a"\nhalf_width_arcsec = 6\ndistribution = "{distribution}"\n'
    (one,) = written(tmp_path, f"[[contribution]]\n{line}").contributions
    assert one.standard == pytest.approx(wanted, rel=1e-4)
    assert (one.kind, one.distribution, one.sensitivity) == ("B", distribution, 1.0)


def test_contributions_are_counted_from_one_and_are_200_at_most(tmp_path):
    lines = ["[[contribution]]", 'name = "a"', "standard_arcsec = 2", ""]
    found = written(tmp_path, "\n".join(lines * 200))
    assert [one.standard for one in found.contributions] == [2.0] * 200
    with pytest.raises(FileError, match="at most 200"):
        written(tmp_path, "\n".join(lines * 201))
    with pytest.raises(FileError, match=r"\[\[contribution\]\] 2 needs a name"):
        written(tmp_path, "\n".join([*lines, "[[contribution]]"]))


def test_what_is_not_stated_is_named_but_for_what_a_certificate_is_whole_without(tmp_path):
    found = written(tmp_path, "")
    assert {"serial", "date", "temperature_C"} <= set(found.not_stated)
    assert not {"number", "item", "address", "specification", "logo"} & set(found.not_stated)
    warm = replace(found, temperature_C=0.0, serial="7")
    assert set(found.not_stated) - set(warm.not_stated) == {"serial", "temperature_C"}
