"""`export_model` and `import_model`: a correction goes into a machine, and comes back."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from os import PathLike, fspath
from pathlib import Path
from typing import Any

from .._core import __version__
from ..angles import ARCSEC_PER_TURN
from ..errors import ArgumentError, TrueAngleError
from ..errorunits import ErrorsIn, error_unit
from ..files import check_output, read_whole, written_atomically
from ..model import HarmonicModel
from ..modelfile import load_model, model_text
from ..plainresult import PlainResult
from .pattern import Pattern
from .proof import Proof, lost_orders, prove
from .target import Header, Made, Target
from .targets import target_of

__all__ = ["Exported", "export_model", "import_model"]

#: Most bytes of a table that is read: a Mechaduino's takes 200 kB as text.
TABLE_BYTES = 16 << 20

#: Bits of the readings on which sizes are compared before the one chosen is proven.
_ROUGH_BITS = 14


@dataclass(frozen=True)
class Exported(PlainResult):
    """A table made of a model, and how far it is from it.

    Attributes
    ----------
    target, sign, argument : str
        ``sign`` is what the target does with a value, ``argument`` the angle at which it
        looks up.
    entries, bytes : int
        Numbers of the table and the memory they take on the target.
    max_difference_arcsec, rms_difference_arcsec : float
        From the model, over every input, in the target's own arithmetic.
    floor_arcsec : float
        rms that the number format alone leaves.
    lost : list of dict
        ``{"order", "arcsec"}``: amplitude by which each order of the model differs.
    proven : bool
        Every input was evaluated, or a bound covers what lies between those that were.
    proof : str
        How.
    zero_deg : float
        Constant of the model that the table leaves to the target's own zero.
    left_out : list of str
        Terms of the model that the table cannot hold.
    notes : list of str
        What to know before it is used.
    text : str
        The file's content.
    output : str or None
        Where it was written.
    """

    target: str
    sign: str
    argument: str
    entries: int
    bytes: int
    max_difference_arcsec: float
    rms_difference_arcsec: float
    floor_arcsec: float
    lost: list[dict[str, float]]
    proven: bool
    proof: str
    zero_deg: float
    left_out: list[str]
    notes: list[str]
    tables: list[dict[str, Any]]
    sha256: str
    text: str = field(repr=False)
    output: str | None = None

    def to_dict(self) -> dict[str, Any]:
        """Everything but the text."""
        return {key: value for key, value in vars(self).items() if key != "text"}

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """What a person wants to know, in some lines.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where one reaches a degree. A
            number is the counts of a turn.
        """
        unit = error_unit(errors_in, self.max_difference_arcsec)
        where = f"{self.output}: " if self.output else ""
        lines = [
            f"{where}{self.entries} entries for {self.target}, {self.bytes} bytes; "
            f"{self.sign}, looked up at the {self.argument} angle",
            f"differs from the model by at most {unit.text(self.max_difference_arcsec)}, "
            f"{unit.number(self.rms_difference_arcsec)} rms ({self.proof}); "
            f"the number format alone leaves {unit.number(self.floor_arcsec)} rms",
        ]
        worst = max(self.lost, key=lambda row: row["arcsec"], default=None)
        if worst is not None:
            lines.append(
                f"of the orders, {worst['order']:g} loses most: {unit.text(worst['arcsec'])}"
            )
        return "\n".join([*lines, *(f"note: {note}" for note in self.notes)])


def export_model(
    model: HarmonicModel | str | PathLike[str],
    target: str,
    path: str | PathLike[str] | None = None,
    *,
    max_arcsec: float | None = None,
    **options: Any,
) -> Exported:
    r"""Write a model's correction as a table that firmware reads, and prove how far it is off.

    A device looks its table up at the indicated angle r, so what is tabulated is

    .. math:: g(r) = r - C_0 - \theta(r), \qquad r = \theta + \varepsilon(\theta)

    by least-squares knots, rounded; a target that looks up at the true angle gets the error
    itself. Every reading of up to 24 bits is then evaluated in the target's arithmetic.

    Parameters
    ----------
    model : HarmonicModel or path
    target : str
        One of `trueangle.export.TARGETS`: "c", "rust", "csv", "simplefoc", "moteus", ...
    path : path, optional
        File to write; without, the text is in the result only.
    max_arcsec : float, optional
        Take the smallest table that differs by at most this, or refuse.
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
    found = target_of(target)
    given = found.checked(options)
    loaded, sha256, inputs = _model(model)
    inputs += [given[name] for name in found.files if given[name] is not None]
    if path is not None:
        check_output(path, found.kind, inputs, [sha256])
        if given.get("name", "") is None:
            given["name"] = Path(path).stem
    if "name" in given and given["name"] is None:
        given["name"] = "angle"
    pattern = Pattern(loaded)
    if pattern.is_empty and not (found.takes_direction and pattern.has_direction):
        raise ArgumentError(
            "the model has no harmonics and nothing else that follows the angle: there is nothing "
            "to put into a table"
        )
    if max_arcsec is None:
        made = found.make(pattern, given)
    else:
        made = _smallest(found, pattern, given, max_arcsec)
    proof = _proven(made, given.get("bits", 24))
    if max_arcsec is not None and proof.max_arcsec > max_arcsec:
        raise ArgumentError(
            f"{target} differs by up to {proof.max_arcsec:.4g} arcsec with these options, and at "
            f"most {max_arcsec:g} is asked for"
        )
    notes = [*made.notes, *_notes(found, pattern, made)]
    header = Header(
        given.get("name", "angle"), sha256, f"trueangle {__version__}", proof, tuple(notes)
    )
    text = made.text(header)
    if path is not None:
        with written_atomically(path, kind=found.kind, inputs=inputs, hashes=[sha256]) as file:
            file.write(text)
    return Exported(
        target=target,
        sign=found.sign_of(given),
        argument=found.argument,
        entries=made.entries,
        bytes=made.bytes,
        max_difference_arcsec=proof.max_arcsec,
        rms_difference_arcsec=proof.rms_arcsec,
        floor_arcsec=made.floor_arcsec,
        lost=_lost(made, pattern),
        proven=found.arithmetic_known,
        proof=proof.how
        if found.arithmetic_known
        else f"{proof.how} as its description has it, the device's own arithmetic is not known",
        zero_deg=made.zero_deg,
        left_out=_left_out(found, pattern),
        notes=notes,
        tables=list(made.tables),
        sha256=sha256,
        text=text,
        output=None if path is None else fspath(path),
    )


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
        Of the target, where the file does not say: ``variant``, ``bits`` ...

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
    found = target_of(target)
    given = found.checked(options)
    raw = read_whole(path, TABLE_BYTES, f"a table of {target}")
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        from ..errors import FileError

        raise FileError(path, f"is no text: a table of {target} is") from None
    model = found.read(text.replace("\r\n", "\n"), fspath(path), given)
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


def _proven(made: Made, bits: int) -> Proof:
    bits = made.bits or bits
    if not 1 <= bits <= 32:
        raise ArgumentError(f"--bits must be from 1 to 32, got {bits}")
    found = [
        prove(part.corrections, part.exact, bits, part.slope, part.resolution)
        for part in made.parts
    ]
    if len(found) == 1 and not made.neglected:
        return found[0]
    return Proof(
        max_arcsec=sum(p.max_arcsec for p in found) + made.neglected * ARCSEC_PER_TURN,
        rms_arcsec=math.hypot(*(p.rms_arcsec for p in found)),
        inputs=found[0].inputs,
        every_input=all(p.every_input for p in found),
        margin_arcsec=sum(p.margin_arcsec for p in found) + made.neglected * ARCSEC_PER_TURN,
        worst=found[0].worst,
    )


def _smallest(target: Target, pattern: Pattern, options: dict[str, Any], max_arcsec: float) -> Made:
    """The first size that keeps ``max_arcsec`` on a rough grid and then on every input."""
    if not (math.isfinite(max_arcsec) and max_arcsec > 0.0):
        raise ArgumentError(f"--max-arcsec must be a positive number, got {max_arcsec!r}")
    sizes = target.sizes(options)
    if not sizes:
        return target.make(pattern, options)
    finer = target.finer(options)
    if finer is not None:
        try:
            return _first(target, pattern, options, max_arcsec, sizes)
        except TrueAngleError:
            options, sizes = dict(finer), target.sizes(finer)
    return _first(target, pattern, options, max_arcsec, sizes)


def _first(
    target: Target,
    pattern: Pattern,
    options: dict[str, Any],
    max_arcsec: float,
    sizes: Sequence[int],
) -> Made:
    best, refused = math.inf, None
    bits = options.get("bits", 24)
    for size in sizes:
        try:
            made = target.make(pattern, {**options, "entries": size})
        except TrueAngleError as error:
            refused = error
            continue
        rough = _proven(replace(made, bits=min(_ROUGH_BITS, made.bits or bits)), 1).max_arcsec
        best = min(best, rough)
        if rough <= max_arcsec:
            exact = _proven(made, bits).max_arcsec
            if exact <= max_arcsec:
                return made
            best = min(best, exact)
    if not math.isfinite(best) and refused is not None:
        raise refused
    raise ArgumentError(
        f"{target.name} does not keep {max_arcsec:g} arcsec: the best of its sizes with these "
        f"options differs by {best:.4g}; ask for more, or for another number format or method"
    )


def _lost(made: Made, pattern: Pattern) -> list[dict[str, float]]:
    if made.lost is not None:
        return made.lost()
    part = made.parts[0]
    found = lost_orders(part.corrections[0], part.exact, pattern.lines)
    return [{"order": float(order), "arcsec": lost} for order, lost in found.items()]


def _left_out(target: Target, pattern: Pattern) -> list[str]:
    return [
        kind for kind, directed in pattern.left_out if not (directed and target.takes_direction)
    ]


def _notes(target: Target, pattern: Pattern, made: Made) -> list[str]:
    notes = []
    left_out = _left_out(target, pattern)
    if left_out:
        notes.append(
            f"the model's {', '.join(left_out)} cannot be held by a table of the angle and "
            f"{'is' if len(left_out) == 1 else 'are'} not exported"
        )
    uncertainty = pattern.uncertainty_arcsec
    if uncertainty is not None and made.floor_arcsec > uncertainty:
        notes.append(
            f"the number format leaves {made.floor_arcsec:.3g} arcsec rms, more than the model's "
            f"own uncertainty of {uncertainty:.3g}"
        )
    if made.zero_deg:
        notes.append(
            f"a constant of {made.zero_deg:.9g} deg is not in the table: the corrected angle is "
            "larger by it, so take it off where the target sets its zero"
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
