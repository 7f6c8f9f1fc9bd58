"""ADMT4000: the magnitudes and phases of its four harmonic registers."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..errors import ArgumentError, FileError
from ..joint.shafts import Shaft
from ..model.model import HarmonicModel
from ..model.records import FitRecord, Provenance, TableRecord
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from ..support.files import FileKind, InputFile, sha256_of
from .pattern import TurnPattern
from .target import CommentBlock, Made, Option, TablePart, Target

#: Order: address of magnitude and phase on page 2, bits of the magnitude.
REGISTERS = {1: (0x15, 0x16, 11), 2: (0x17, 0x18, 11), 3: (0x19, 0x1A, 8), 8: (0x1B, 0x1C, 8)}
#: Degrees of a magnitude's unit before the gain of the CORDIC, and of a phase's.
_MAGNITUDE = 360.0 / 65536.0
_CORDIC = 0.6072
_PHASE = 360.0 / 4096.0

_GRID = 1 << 14
_LINE = re.compile(r"^\s*H([1238])(MAG|PH)\s+0x([0-9A-Fa-f]+)\s+0x([0-9A-Fa-f]+)\b")


class Admt4000(Target):
    """Target ``admt4000``: one line per register of page 2."""

    name = "admt4000"
    what = "the harmonic registers of an ADMT4000"
    kind: ClassVar[FileKind] = FileKind("register values of an ADMT4000", (".txt",))
    sign = "subtract"
    unknown = (
        "format checked, device not: sign and phase are those of the maker's own tool, and no "
        "model of the device's arithmetic exists; measure after writing"
    )
    arithmetic_known = False
    options = {"bits": Option(int, 24, "bits of a reading, at most 24: all are evaluated")}

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        pattern.check_one_turn(self.name)
        x = np.arange(_GRID) / _GRID
        values = pattern.correction(x)
        spectrum = np.fft.rfft(values) * (2.0 / _GRID)
        codes: dict[int, tuple[int, int]] = {}
        for order, (_, _, bits) in REGISTERS.items():
            # A cos + B sin = C sin(k x + phi): A is the real part, B minus the imaginary one.
            a, b = spectrum[order].real, -spectrum[order].imag
            magnitude = round(math.hypot(a, b) * 360.0 * _CORDIC / _MAGNITUDE)
            if magnitude >= 1 << bits:
                deg = math.hypot(a, b) * 360.0
                raise ArgumentError(
                    f"admt4000: order {order} has {deg:.4g} deg, and its register "
                    f'holds {((1 << bits) - 1) * _MAGNITUDE / _CORDIC:.4g}; use `target="c"`'
                )
            phase = round(math.degrees(math.atan2(a, b)) / _PHASE) % (1 << 12)
            codes[order] = magnitude, phase if magnitude else 0
        if not any(magnitude for magnitude, _ in codes.values()):
            raise ArgumentError(
                "admt4000 holds orders 1, 2, 3 and 8, and the model has none of them above "
                f'its step of {_MAGNITUDE / _CORDIC:.3g} deg; use `target="c"`'
            )
        mean = float(np.mean(values))
        zero = pattern.zero + mean
        left = values - mean - _series(codes, x)
        missing = [k for k in pattern.lines if k not in REGISTERS]
        notes = [
            "keep the reserved upper bits of each register, set bit 10 of GENERAL for the user's "
            "order 8, and compute the ECC registers again"
        ]
        if missing:
            rms = float(np.sqrt(np.mean(left**2))) * ARCSEC_PER_TURN
            shown = ", ".join(f"{k:g}" for k in missing[:8])
            notes.insert(
                0,
                f"order{'s'[: len(missing) != 1]} {shown} {'has' if len(missing) == 1 else 'have'} "
                f"no register: {rms:.4g} arcsec rms are left",
            )

        def text(header: CommentBlock) -> str:
            own = "page 2 of the ADMT4000: register, address, value, bits that are written"
            lines = header.comment("# ", own)
            for order, (magnitude, phase) in codes.items():
                at_magnitude, at_phase, bits = REGISTERS[order]
                lines.append(
                    f"H{order}MAG 0x{at_magnitude:02X} 0x{magnitude:03X} 0x{(1 << bits) - 1:03X}"
                )
                lines.append(f"H{order}PH 0x{at_phase:02X} 0x{phase:03X} 0xFFF")
            return "\n".join(lines) + "\n"

        step = _MAGNITUDE / _CORDIC / 360.0
        return Made(
            text=text,
            entries=8,
            bytes=16,
            part=TablePart.at_readings(
                pattern,
                lambda angles: _series(codes, angles / 2.0**32),
                zero=zero,
            ),
            floor_arcsec=math.sqrt(len(codes) / 24.0) * step * ARCSEC_PER_TURN,
            zero_deg=zero * 360.0,
            notes=tuple(notes),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        codes: dict[int, dict[str, int]] = {}
        for line in text.split("\n"):
            found = _LINE.match(line)
            if found is not None:
                codes.setdefault(int(found[1]), {})[found[2]] = int(found[4], 16)
        if not codes or any(set(code) != {"MAG", "PH"} for code in codes.values()):
            raise FileError(
                path, "lines such as 'H1MAG 0x15 0x123' and 'H1PH 0x16 0x045' are wanted"
            )
        orders = sorted(codes)
        sizes, phases = [], []
        for order in orders:
            bits = REGISTERS[order][2]
            sizes.append((codes[order]["MAG"] & ((1 << bits) - 1)) * _MAGNITUDE / _CORDIC)
            phases.append(math.radians((codes[order]["PH"] & 0xFFF) * _PHASE))

        step = _MAGNITUDE / _CORDIC
        std = step / math.sqrt(12.0)
        return HarmonicModel(
            (
                Shaft(
                    "output",
                    1.0,
                    tuple(orders),
                    tuple(c * math.sin(phase) for c, phase in zip(sizes, phases, strict=True)),
                    tuple(c * math.cos(phase) for c, phase in zip(sizes, phases, strict=True)),
                ),
            ),
            period=360.0,
            argument="indicated",
            covariance=np.diag([0.0, *[std**2] * (2 * len(orders))]),
            fit=FitRecord(
                samples=2 * len(orders),
                runs=1,
                span=(0.0, 360.0),
                residual=std,
                method="table",
                note="read from registers of an ADMT4000, whose argument is the indicated angle",
                table=TableRecord(self.name, self.argument, 0.0, 0.0),
            ),
            provenance=Provenance((InputFile(path, sha256_of(path)),)),
        )


def _series(codes: Mapping[int, tuple[int, int]], x: Array) -> Array:
    """Turns of the registers' harmonics at readings in turns."""
    total = np.zeros_like(x, dtype=np.float64)
    for order, (magnitude, phase) in codes.items():
        size = magnitude * _MAGNITUDE / _CORDIC / 360.0
        total += size * np.sin(2.0 * math.pi * order * x + math.radians(phase * _PHASE))
    return total
