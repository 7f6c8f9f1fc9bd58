"""What a model file says of its making: the fit, and where its readings came from."""

from __future__ import annotations

from dataclasses import dataclass

from ..support.files import Source

__all__ = ["FitRecord", "Provenance", "TableRecord"]


@dataclass(frozen=True)
class TableRecord:
    """The table of a machine that a model was read from.

    ``target`` is the machine's name in `trueangle.export_model`, ``argument`` the angle at which it
    looks up; ``rms`` and ``max_abs`` are what its own arithmetic (lines between its entries,
    whole numbers) does beside the model, in the unit of the model's period.
    """

    target: str
    argument: str
    rms: float
    max_abs: float


@dataclass(frozen=True)
class FitRecord:
    """How a model was fitted: what its file says under ``fit``.

    ``span`` is the stretch of angles the fit has seen, ``(0, period)`` for a full turn;
    ``residual`` is the residual standard deviation (None where no reading is left over to
    take it from), ``offsets`` the zero of every run and ``offset_spread`` their standard
    deviation, all in the unit of the model's period. ``positions`` counts the distinct
    angles within a turn; ``note`` says where the model is verified and where not.
    ``calibrated_without_reference`` marks a model of `trueangle.selfcal`, and ``blind`` what
    such a model cannot know, one sentence each. ``signals`` holds the range of each signal that
    the terms of the model were found over, ``(name, lowest, highest)``, and ``table`` is there
    where the model was read from a machine.
    """

    samples: int
    runs: int
    span: tuple[float, float]
    residual: float | None
    method: str = "plain"
    loss: str = "linear"
    wild: int = 0
    ridge: float = 0.0
    offsets: tuple[float, ...] = ()
    offset_spread: float = 0.0
    positions: int | None = None
    note: str = ""
    calibrated_without_reference: bool = False
    blind: tuple[str, ...] = ()
    signals: tuple[tuple[str, float, float], ...] = ()
    table: TableRecord | None = None


@dataclass(frozen=True)
class Provenance:
    """Where a model came from: its input files with their sha256, and the package."""

    inputs: tuple[Source, ...] = ()
    package: str = ""
