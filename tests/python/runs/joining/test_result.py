"""What a joining tells: every figure with its own error, in words as in JSON."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.runs.joining.result import Gap, Joined

#: Printed to two digits of the error.
DIGITS = 0.06

#: No two figures alike.
ANGLE = np.linspace(0.0, 350.0, 36)
FOUND = Joined(
    [ta.CalibrationRun(ANGLE[:n], ANGLE[:n], period=360.0) for n in (20, 36)],
    12.3456, -78.9, 0.0123, 4.56, 0.789, (Gap(1.0, 2.0, 3), Gap(4.0, 5.5, 4)), 17, (), (),
)  # fmt: skip


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_every_figure_stands_with_its_own_error(errors_in, per) -> None:
    plain, text = FOUND.to_dict(), FOUND.summary(errors_in)
    said = dict(re.findall(r"^  (\w+) +(.*)$", text, re.M))
    for name, unit in (("offset", "s"), ("rate", "ppm")):
        value, std = re.fullmatch(rf"(\S+) \+- (\S+) {unit}", said[name]).groups()
        wanted = plain[f"{name}_std_{unit}"]
        assert float(std) == pytest.approx(wanted, rel=DIGITS)
        assert float(value) == pytest.approx(plain[f"{name}_{unit}"], abs=DIGITS * wanted)
    added = re.fullmatch(rf"adds (\S+) {errors_in} standard deviation", said["joining"])
    assert float(added[1]) == pytest.approx(per * plain["std_arcsec"], rel=1e-3)
    assert int(said["gaps"]) == len(plain["gaps"]) == 2
    counts = re.match(r"(\d+) of (\d+) readings discarded: at their time", text)
    assert [*map(int, counts.groups())] == [17, 17 + plain["readings"]]
    counts = re.search(r"^(\d+) readings joined in (\d+) runs$", text, re.M)
    assert [*map(int, counts.groups())] == [plain[k] for k in ("readings", "runs")]
    kept = replace(FOUND, left_out=0).summary(errors_in)
    assert kept.startswith("56 readings joined in 2 runs")
    assert (plain["readings"], plain["left_out"]) == (56, 17)


def test_what_is_declared_has_no_error() -> None:
    declared = replace(FOUND, offset_std_s=None, rate_std_ppm=None)
    assert "+-" not in declared.summary()
    assert declared.to_dict()["offset_std_s"] is declared.to_dict()["rate_std_ppm"] is None
