"""Picture of the how-to on channels: the curve and the error over the turn, before and after."""

from __future__ import annotations

import matplotlib as mpl
import numpy as np

import trueangle as ta


def channel_picture() -> mpl.figure.Figure:
    """Lissajous figure of two ADC channels with faults, and the errors of the decoded angle."""
    rng = np.random.default_rng(1)
    theta = np.linspace(0.0, 360.0, 2000)
    true = ta.Channels(
        offset_sine=2180.0,
        offset_cosine=1960.0,
        amplitude=900.0,
        gain_ratio=1.12,
        phase_deg=-6.0,
        harmonics=((-3, 0.02, 0.01, 0.0),),
        period=360.0,
    )
    sine, cosine = (c + 2.0 * rng.normal(size=theta.size) for c in true.curve(np.radians(theta)))
    found = ta.selfcal({"sine": sine, "cosine": cosine}).channels
    y, x = sine - 2048.0, cosine - 2048.0
    after = np.radians(found.correct(sine, cosine))
    figure, (curve, errors) = mpl.pyplot.subplots(1, 2, figsize=(8.0, 3.4), layout="constrained")
    curve.plot(x, y, lw=1.2, label="counts less 2048")
    radius = abs(found.fundamental)
    curve.plot(radius * np.cos(after), radius * np.sin(after), lw=1.2, label="decoded, one radius")
    curve.axhline(0.0, color="0.8", lw=0.8, zorder=0)
    curve.axvline(0.0, color="0.8", lw=0.8, zorder=0)
    curve.set(xlabel="cosine, counts", ylabel="sine, counts", aspect="equal")
    curve.set_ylim(-1350.0, 1950.0)
    curve.legend(loc="upper center", frameon=False, fontsize="small")
    for name, angle in {"arctan2 of the counts": np.arctan2(y, x), "by the model": after}.items():
        error = ta.wrap(np.degrees(angle) - theta, 360.0)
        errors.plot(theta, error - error.mean(), lw=1.0, label=f"{name}: {error.std():.2g} deg rms")
    errors.set(xlabel="true angle, deg", ylabel="error, deg", xticks=np.arange(0, 361, 90))
    errors.set_ylim(-15.0, 19.0)
    errors.legend(loc="upper center", frameon=False, fontsize="small")
    return figure
