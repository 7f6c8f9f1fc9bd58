"""``trueangle import``: what a present table does."""

from __future__ import annotations

import argparse
from functools import partial

from ..support.display_units import error_unit
from ..support.layout import counted, laid_out
from ..support.plainresult import json_text
from .export import add_target_options, target_options
from .options import add_shared, errors_in
from .parser import Input, declare

HELP = "read a table that firmware has, as a model: what does my present table do?"
EXAMPLE = "trueangle import printer.cfg --from klipper -o present.json"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command's arguments."""
    from ..export.targets import TARGETS

    add = partial(declare, parser)
    add("file FILE", Input, "source, configuration or registers that hold the table")
    add(
        "--from TARGET",
        tuple(TARGETS),
        f"target of the table: {', '.join(TARGETS)}",
        required=True,
        dest="source",
    )
    add_shared(parser, "model-output")
    add_target_options(parser)
    add_shared(parser, "errors-in")
    add("--json", bool, "print what the table corrects as JSON")


def run(args: argparse.Namespace) -> int:
    """Read the table and write the model."""
    import math

    from ..export import import_model
    from ..support.angles import ARCSEC_PER_TURN, zero_text

    model = import_model(args.file, args.source, args.output, **target_options(args))
    unit = ARCSEC_PER_TURN / model.period
    rows = [
        {"order": order, "amplitude_arcsec": c * unit, "phase_deg": math.degrees(phase) % 360.0}
        for order, c, phase in zip(model.orders, model.amplitudes, model.phases, strict=True)
    ]
    if args.json:
        content = {
            "source": args.source,
            "output": args.output,
            "orders": rows,
            "zero_deg": model.constant / model.period * 360.0,
            "terms": [term.kind for term in model.terms],
            "resolution_arcsec": (model.fit.residual or 0.0) * unit if model.fit else None,
        }
        print(json_text(content))
        return 0
    largest = max((row["amplitude_arcsec"] for row in rows), default=0.0)
    shown = error_unit(errors_in(args), largest, model.period)
    zero = zero_text(model.constant * 360.0 / model.period, 360.0)
    lines = [f"{args.output}: {counted(rows, 'order')}, zero {zero}"]
    # Orders that are printed, the largest ones.
    for row in sorted(rows, key=lambda row: -row["amplitude_arcsec"])[:12]:
        amplitude, phase = shown.text(row["amplitude_arcsec"]), row["phase_deg"]
        lines.append(f"  order {row['order']:g}: {amplitude} at {phase:.1f} deg")
    if model.fit and model.fit.note:
        lines.append(f"note: {model.fit.note}")
    print(laid_out(lines))
    return 0
