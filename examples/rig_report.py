"""From a rig's CSV file to a report and a model: a magnetic encoder on a turntable.

    python examples/rig_report.py [READINGS.csv] [-o FOLDER]

Without a file it takes ``rm44_repeat.csv`` from ``../shared/data`` (or ``$TRUEANGLE_DATA``):
an RLS RM44 against a TONiC reference, twelve repeats of one turn. Where that is not
present either, a simulated encoder of the same kind replaces it.
"""

from __future__ import annotations

import argparse
import os
from pathlib import Path

import numpy as np

import trueangle as ta

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("TRUEANGLE_DATA", ROOT.parent / "shared" / "data"))


def simulated() -> list[ta.CalibrationRun]:
    """Orders 1, 2 and 4 of a magnet off its axis, in degrees, with an arbitrary zero."""
    rng = np.random.default_rng(0)
    theta = np.linspace(0.0, 360.0, 500, endpoint=False)
    x = np.radians(theta)
    error = 0.42 * np.sin(x + 1.0) + 0.13 * np.sin(2 * x) + 0.28 * np.sin(4 * x + 2.0) - 109.4
    return [
        ta.CalibrationRun(theta, theta + error + rng.normal(0, 0.05, 500), 360.0, label=f"run {i}")
        for i in range(6)
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("readings", nargs="?", type=Path, default=DATA / "rm44_repeat.csv")
    parser.add_argument("-o", "--output", type=Path, default=Path("rig"), help="folder to write")
    args = parser.parse_args()
    runs = ta.read_runs(args.readings) if args.readings.is_file() else simulated()

    args.output.mkdir(exist_ok=True)
    fit = ta.fit(runs)
    fit.model.save(args.output / "model.json")
    print(fit.summary())

    report = ta.report(runs, args.output / "report.html")
    gain = report.content["gain"]
    before, after = (gain[when]["rms_arcsec"] for when in ("before", "after"))
    print(f"\nheld-out runs: rms {before:.1f} -> {after:.1f} arcsec")
    print(f"wrote {args.output / 'model.json'} and {args.output / 'report.html'}")


if __name__ == "__main__":
    main()
