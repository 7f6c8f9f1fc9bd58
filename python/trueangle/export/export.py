"""`export_model` and `import_model`: a correction goes into a machine, and comes back."""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Sequence
from dataclasses import replace
from os import PathLike, fspath
from pathlib import Path
from typing import Any, TextIO, cast

from .._core import __version__
from ..errors import ArgumentError, FileError, NotInvertibleError, TrueAngleError
from ..model.file import load_model
from ..model.model import HarmonicModel
from ..model.writing import model_text
from ..support.argumentkinds import told_kinds
from ..support.display_units import error_unit
from ..support.files import check_output, read_whole, written_atomically
from .codetext import check_choice
from .exported import HEADER_DIGITS, Exported, run_time_bound, term_sizes
from .pattern import TurnPattern
from .proof import Proof, lost_orders, prove_export, rounded_up
from .target import CommentBlock, Made, Target
from .targets import export_target


@told_kinds
def export_model(
    model: HarmonicModel | str | PathLike[str],
    target: str,
    path: str | PathLike[str] | None = None,
    *,
    max_arcsec: float | None = None,
    **options: Any,
) -> Exported:
    """Write a model's correction as a table that firmware reads, and prove how far it is off.

    A device looks its table up at the indicated angle r, so what is tabulated is

    ::

        g(r) = r - C₀ - θ(r),    r = θ + ε(θ)

    by least-squares knots, rounded; a target that looks up at the true angle gets the error
    itself. Every reading of up to 24 bits is then evaluated in the target's arithmetic.

    Of a model whose ``indicated_sign`` is -1 the table is that of the sensor's own reading
    (`HarmonicModel.in_sensor_sense`), and a note states it. "mujoco" holds the model as it is.

    Parameters
    ----------
    model : HarmonicModel or path
    target : str
        One of `trueangle.export.TARGETS`: "c", "rust", "csv", "simplefoc", "moteus", ... "fmu",
        "mujoco". "c" and "rust" compute terms at run time, "fmu" and "mujoco" hold the model.
    path : path, optional
        File to write; without, the text is in the result only.
    max_arcsec : float, optional
        Use the smallest table that differs by at most this, including what is omitted, or
        refuse.
    **options
        Of the target: ``entries``, ``bits``, ``method``, ``number`` ...

    Returns
    -------
    Exported

    Raises
    ------
    ArgumentError
        A target or an option that is not there; a table that cannot hold the model, with the
        orders at fault and the smallest setting that can. Nothing is written then.
    FileError
        An output that is an input, or of another format.

    Notes
    -----
    The proof of 2^24 readings takes about a second; ``bits=16`` takes some milliseconds.

    Examples
    --------
    >>> import trueangle as ta
    >>> model = ta.HarmonicModel([ta.Shaft("output", 1, [1, 2], [0.3, 0], [0, 0.1])], period=360.0)
    >>> made = ta.export_model(model, "c", entries=128, number="q15", bits=16)
    >>> made.sign, made.argument, made.entries, made.bytes, made.proven
    ('subtract', 'indicated', 128, 258, True)
    >>> made.max_difference_arcsec < 1.0
    True
    """
    found = export_target(target)
    given = found.checked(options)
    loaded, sha256, inputs = _model(model)
    inputs += [given[name] for name in found.files if given[name] is not None]
    if path is not None:
        check_output(path, found.kind, inputs, [sha256])
        if given.get("name", "") is None:
            given["name"] = Path(path).stem
    if "name" in given and given["name"] is None:
        given["name"] = "angle"
    pattern = TurnPattern(loaded.in_sensor_sense() if found.at_sensor else loaded)
    channels = pattern.source.channels if found.decodes else None
    decodes = channels is not None
    if channels is not None:
        check_choice(channels)
    holds_any = any(map(found.holds, pattern.left_out)) or decodes or found.may_be_empty(given)
    if pattern.is_empty and not holds_any:
        raise ArgumentError(
            "the model has no harmonics and nothing else that follows the angle: there is nothing "
            "to put into a table"
        )
    rows = term_sizes(pattern, [t for t in pattern.left_out if not found.holds(t)])
    beside = sum(row["size_arcsec"] for row in rows)
    computed = found.at_run_time(pattern, given)
    held = [] if computed is None else [t for t in pattern.left_out if found.holds(t)]
    at_run_time = term_sizes(pattern, held)
    steep, rounding = 1.0, 0.0
    if computed is not None:
        steep, rounding = run_time_bound(pattern, computed, at_run_time)
    if max_arcsec is None:
        made, proof = _made(found, pattern, given)
    else:
        left = _share(max_arcsec, beside, rows, steep, rounding)
        made, proof = _smallest(found, pattern, given, left)
    largest = rounded_up(proof.max_arcsec)
    total = rounded_up(steep * largest + rounding + beside) if rows or at_run_time else largest
    if max_arcsec is not None and total > max_arcsec:
        raise ArgumentError(
            f"{target} differs by up to {total:.4g} arcsec with these options, and at "
            f"most {max_arcsec:g} is allowed; allow more, or make the table finer"
        )
    notes = [*made.notes, *_notes(found, pattern, made)]
    if found.at_sensor and loaded.indicated_sign < 0:
        notes.insert(0, _REVERSED)
    result = Exported(
        target=target,
        sign=found.sign_of(given),
        argument=found.argument,
        entries=made.entries,
        bytes=made.bytes,
        max_difference_arcsec=largest,
        max_difference_total_arcsec=total,
        rms_difference_arcsec=proof.rms_arcsec,
        floor_arcsec=made.floor_arcsec,
        lost=_lost(made, pattern),
        proven=found.arithmetic_known,
        proof=found.how(proof),
        zero_deg=made.zero_deg,
        left_out=rows,
        at_run_time=at_run_time,
        notes=notes,
        tables=list(made.tables),
        sha256=sha256,
        text="",
        output=None if path is None else fspath(path),
    )
    header = CommentBlock(
        given.get("name", "angle"),
        f"D{result.difference(error_unit('arcsec'), HEADER_DIGITS)[1:]}.",
        proof,
        _source(pattern, sha256, None if isinstance(model, HarmonicModel) else fspath(model)),
        tuple(notes),
    )
    text = made.text(header)
    if path is not None:
        with written_atomically(path, kind=found.kind, inputs=inputs, hashes=[sha256]) as file:
            if made.packed is None:
                file.write(text)
            else:
                cast(TextIO, file).buffer.write(made.packed(text))
    return replace(result, text=text)


@told_kinds
def import_model(
    path: str | PathLike[str],
    target: str,
    output: str | PathLike[str] | None = None,
    **options: Any,
) -> HarmonicModel:
    """Read a table that firmware has, as a model of what it corrects.

    Parameters
    ----------
    path : path
        The file that holds the table: source, configuration or registers.
    target : str
        What it is of, as in `export_model`.
    output : path, optional
        Model file to write.
    **options
        Of the target, where the file does not state: ``variant``, ``bits`` ...

    Returns
    -------
    HarmonicModel
        In degrees. The standard deviation of its coefficients is that of numbers rounded to
        the table's resolution.

    Raises
    ------
    FileError
        Not a table of this target: file, line and what is wrong.
    """
    found = export_target(target)
    given = found.checked(options)
    # Most bytes of a table that is read: a Mechaduino's takes 200 kB as text.
    raw = read_whole(path, 16 << 20, f"a table of {target}")
    try:
        text = found.decoded(raw)
    except UnicodeDecodeError:
        raise FileError(path, f"is not text: a table of {target} is") from None
    try:
        model = found.read(text.replace("\r\n", "\n"), fspath(path), given)
    except (ArgumentError, NotInvertibleError) as error:
        if fspath(path) in str(error):
            raise
        raise FileError(path, f"is no table of {target} that makes a model: {error}") from None
    if output is not None:
        model.save(output)
    return model


def _model(
    model: HarmonicModel | str | PathLike[str],
) -> tuple[HarmonicModel, str, list[str | PathLike[str]]]:
    if isinstance(model, HarmonicModel):
        digest = hashlib.sha256(model_text(model).encode("utf-8")).hexdigest()
        return model, digest, []
    if isinstance(model, (str, PathLike)):
        loaded = load_model(model)
        return loaded, hashlib.sha256(Path(model).read_bytes()).hexdigest(), [model]
    raise ArgumentError(
        f"model must be a HarmonicModel or a model file, got {type(model).__name__}: "
        "of a fit take .model"
    )


def _source(pattern: TurnPattern, sha256: str, path: str | None) -> tuple[str, ...]:
    """Lines on the model of a table: its file, what it was made from, where it holds."""
    model = pattern.source
    names = ", ".join(source.file for source in model.provenance.inputs[:_MOST_FILES])
    more = len(model.provenance.inputs) - _MOST_FILES
    lines = [
        f"Made by trueangle {__version__}. Model: {path or 'in memory'}, sha256 {sha256}"
        + (f", fitted from {names}" if names else "")
        + (f" and {more} more" if more > 0 else "")
    ]
    span = model.partial_span
    if span is not None:
        turn = 360.0 / pattern.period
        lines.append(f"Calibrated from {span[0] * turn:.6g} to {span[1] * turn:.6g} deg.")
    return tuple(lines)


#: Files of readings that a table names.
_MOST_FILES = 4


def _share(
    max_arcsec: float, beside: float, rows: list[dict[str, Any]], steep: float, rounding: float
) -> float:
    """What of the largest difference is left to the table."""
    if not (math.isfinite(max_arcsec) and max_arcsec > 0.0):
        raise ArgumentError(f"max_arcsec must be a positive number, got {max_arcsec!r}")
    if beside >= max_arcsec:
        names = ", ".join(f"{row['term']} {row['size_arcsec']:.4g} arcsec" for row in rows)
        raise ArgumentError(
            f"a table of the angle omits {names}, and at most {max_arcsec:g} is allowed; allow more"
        )
    left = (max_arcsec - beside - rounding) / steep
    if left <= 0.0:
        raise ArgumentError(
            f"float arithmetic of the terms leaves {rounding:.4g} arcsec, and at most "
            f"{max_arcsec:g} is allowed; allow more"
        )
    return left


def _made(target: Target, pattern: TurnPattern, options: dict[str, Any]) -> tuple[Made, Proof]:
    """A table and its proof."""
    made = target.make(pattern, options)
    return made, _proven(made, options.get("bits", 24))


def _proven(made: Made, bits: int) -> Proof:
    bits = made.bits or bits
    if not 1 <= bits <= 32:
        raise ArgumentError(f"bits must be from 1 to 32, got {bits}")
    part = made.part
    return prove_export(
        part.corrections, part.exact, bits, part.resolution, part.turns, part.continuous
    )


def _smallest(
    target: Target, pattern: TurnPattern, options: dict[str, Any], max_arcsec: float
) -> tuple[Made, Proof]:
    """The first size that keeps ``max_arcsec`` on a rough grid and then on every input."""
    sizes = target.sizes(options)
    if not sizes:
        return _made(target, pattern, options)
    *others, last = options, *target.finer(options)
    for tried in others:
        with contextlib.suppress(TrueAngleError):
            return _first(target, pattern, dict(tried), max_arcsec, target.sizes(tried))
    return _first(target, pattern, dict(last), max_arcsec, target.sizes(last))


def _first(
    target: Target,
    pattern: TurnPattern,
    options: dict[str, Any],
    max_arcsec: float,
    sizes: Sequence[int],
) -> tuple[Made, Proof]:
    best, refused = math.inf, None
    bits = options.get("bits", 24)
    for size in sizes:
        try:
            made = target.make(pattern, {**options, "entries": size})
        except TrueAngleError as error:
            refused = error
            continue
        part = made.part._replace(continuous=False)
        # Bits of the readings on which sizes are compared before the one chosen is proven.
        rough_bits = min(14, made.bits or bits)
        looked = _proven(replace(made, part=part, bits=rough_bits), 1)
        # What lies between the few readings of a rough look is left to the closer one.
        rough = looked.max_arcsec - looked.margin_arcsec
        best = min(best, rough)
        if rough <= max_arcsec:
            proof = _proven(made, bits)
            if proof.max_arcsec <= max_arcsec:
                return made, proof
            best = min(best, proof.max_arcsec)
    if not math.isfinite(best) and refused is not None:
        raise refused
    raise ArgumentError(
        f"{target.name} does not keep {max_arcsec:g} arcsec: the best of its sizes with these "
        f"options differs by {best:.4g}; allow more, or use another number format or method"
    )


def _lost(made: Made, pattern: TurnPattern) -> list[dict[str, float]]:
    if made.lost is not None:
        return made.lost()
    part = made.part
    found = lost_orders(part.corrections[0], part.exact, pattern.lines)
    return [{"order": float(order), "arcsec": lost} for order, lost in found.items()]


#: Of every table for a sensor that counts the other way than the reference.
_REVERSED = (
    "the sensor counts the other way than the reference: readings, corrected angles, velocity and "
    "direction count as the sensor does"
)


def _notes(target: Target, pattern: TurnPattern, made: Made) -> list[str]:
    notes = []
    beside = [t.kind for t in pattern.left_out if not target.holds(t)]
    if beside:
        notes.append(
            f"the model's {', '.join(beside)} cannot be held by a table of the angle and "
            f"{'is' if len(beside) == 1 else 'are'} not exported"
        )
    uncertainty = pattern.uncertainty_arcsec
    if uncertainty is not None and made.floor_arcsec > uncertainty:
        notes.append(
            f"the number format adds {made.floor_arcsec:.3g} arcsec rms, more than the "
            f"model's uncertainty of {uncertainty:.3g}"
        )
    if round(made.zero_deg, 9):
        notes.append(
            f"subtract {made.zero_deg:.9f} deg where the target sets "
            "its zero: the table omits this constant"
            + (
                ""
                if target.argument == "indicated"
                else "; do so before the table, whose positions are true angles"
            )
        )
    channels = pattern.source.channels
    if channels is not None and not made.decodes:
        notes.append(
            "the reading is the angle decoded from the channels: x = (cosine - "
            f"{channels.offset_cosine:.9g}) * {channels.constants[2]:.9g}, y = (sine - "
            f"{channels.offset_sine:.9g}) * {channels.constants[3]:.9g} - x * "
            f"{channels.constants[4]:.9g}, {'-' if channels.direction < 0 else ''}atan2(y, x)"
            + (f" / {channels.periods_per_turn}" if channels.periods_per_turn > 1 else "")
        )
    span = pattern.source.partial_span
    if span is not None:
        turn = 360.0 / pattern.period
        notes.append(
            f"the model was fitted from {span[0] * turn:.4g} to {span[1] * turn:.4g} deg only: "
            "outside, the table is a guess"
        )
    if target.unknown:
        notes.append(target.unknown)
    return notes
