"""Delta Tau PMAC: the leadscrew compensation table of a motor."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..support.files import FileKind
from .knots import rounding_floor
from .pattern import TurnPattern
from .proof import enough_bits
from .reading import ReadTable, function_model
from .setpoint import SetpointTravel
from .table import TURN
from .target import CommentBlock, Made, Option, Target

#: Parts of a count in an entry.
SIXTEENTHS = 16
_MOST = 5000
#: Counts and entries, at most.
_LARGEST = 1 << 53
_SIZES = (32, 36, 40, 45, 48, 50, 60, 64, 72, 80, 90, 100, 120, 128, 144, 180, 200, 240, 250, 256,
          300, 320, 360, 400, 450, 480, 500, 512, 600, 720, 1000, 1024, 2048)  # fmt: skip
_DEFINE = re.compile(
    r"(?:#\s*\d+\s*)?DEFINE\s+COMP\s+(\d+)\s*,\s*(?:#[^,]*,\s*)*(\d+)\b", re.IGNORECASE
)


class Pmac(Target):
    """Target ``pmac``: ``DEFINE COMP``, sixteenths of a count over one turn."""

    name = "pmac"
    what = "the leadscrew compensation table of a PMAC motor"
    kind: ClassVar[FileKind] = FileKind("commands for PMAC", (".pmc", ".cfg", ".txt"))
    sign = "add"
    argument = "reference"
    unknown = (
        "written by the maker's documentation and not run on the device: make the check in the "
        "file before the axis works with it"
    )
    options = {
        "counts_per_turn": Option(int, None, "counts of the motor's encoder to an output turn"),
        "entries": Option(
            int, None, "to a turn, a divisor of the counts (default: the most up to 360)"
        ),
        "motor": Option(int, 1, "number of the motor"),
        "bits": Option(int, 20, "2^bits positions are evaluated, and more where entries are many"),
    }

    def sizes(self, options: Mapping[str, Any]) -> Sequence[int]:
        counts = self._counts(options)
        return [size for size in _SIZES if counts % size == 0]

    def _counts(self, options: Mapping[str, Any]) -> int:
        counts = options["counts_per_turn"]
        if counts is None:
            raise ArgumentError("pmac needs `counts_per_turn=`: its table is in counts")
        if not 16 <= counts <= 2**40:
            raise ArgumentError(f"counts_per_turn must be from 16 to 2^40, got {counts}")
        return int(counts)

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        counts = self._counts(options)
        divisors = [n for n in range(4, min(counts, _MOST) + 1) if counts % n == 0]
        entries = options["entries"]
        if not divisors or entries not in (None, *divisors):
            near = sorted(divisors, key=lambda n: abs(n - (entries or 256)))[:3]
            raise ArgumentError(
                f"entries must be a divisor of {counts} from 4 to {_MOST}, got {entries}; near it "
                f"are {', '.join(map(str, near)) or 'none'}"
            )
        whole_turn = {"entries": entries, "start": 0.0, "stop": 360.0}
        # One column for both directions: what follows the direction is omitted.
        pattern = TurnPattern(pattern.model)
        travel = SetpointTravel.of(pattern, self.name, whole_turn, _MOST + 1, divided=counts)
        entries = travel.entries
        # The correction at zero is zero by definition: what it is there is left to the zero.
        first = float(travel.forward[0])
        values = np.rint((travel.forward - first) * counts * SIXTEENTHS).astype(np.int64)
        values[-1] = values[0]

        def text(header: CommentBlock) -> str:
            k = int(np.argmax(np.abs(values)))
            own = [
                f"Leadscrew compensation of motor {options['motor']}: {entries} entries over "
                f"{counts} counts (one turn), in sixteenths of a count, the first one spacing from "
                "the motor's zero. An entry is added to the commanded position, so that the "
                "encoder is brought to where it reads what belongs there.",
                f"Check 1: command motor {options['motor']} to {k * (counts // entries)} counts "
                "with I51=0, then set I51=1.",
                f"Check 2: its encoder must go on by {values[k] / SIXTEENTHS:.6g} counts; where it "
                "goes the other way, turn the sign of every entry.",
            ]
            lines = header.comment("; ", *own)
            lines.append(f"#{options['motor']} DEFINE COMP {entries},{counts}")
            words = [str(int(v)) for v in values[1:]]
            lines += [" ".join(words[i : i + 16]) for i in range(0, len(words), 16)]
            return "\n".join([*lines, "I51=1", ""])

        step = 1.0 / counts / SIXTEENTHS
        printed = values / (counts * SIXTEENTHS) + first
        return Made(
            text=text,
            entries=entries,
            bytes=3 * entries,
            part=travel.part(pattern, printed, printed),
            floor_arcsec=rounding_floor(step),
            zero_deg=(pattern.zero + first) * 360.0,
            bits=enough_bits(options["bits"], entries),
            lost=lambda: travel.lost(pattern),
            notes=(
                "it rolls over after a turn; define the tables from the highest motor down, and "
                "delete other buffers before",
            ),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        plain = "\n".join(line.partition(";")[0] for line in text.split("\n"))
        found = _DEFINE.search(plain)
        if found is None:
            raise FileError(path, f"no DEFINE COMP: no table of {self.name}")
        count, span = int(found[1]), int(found[2])
        line = plain.count("\n", 0, found.start()) + 1
        words = plain[found.end() :].split()
        try:
            values = np.array([int(word) for word in words[:count]])
        except ValueError as error:
            raise FileError(path, f"entries are whole numbers: {error}", line=line) from None
        if not 4 <= count <= _MOST or len(values) != count or not 1 <= span <= _LARGEST:
            raise FileError(
                path, f"DEFINE COMP {count},{span} with {len(values)} entries", line=line
            )
        if np.max(np.abs(values)) > _LARGEST:
            raise FileError(
                path, f"an entry is beyond {_LARGEST}: no table of {self.name}", line=line
            )
        counts = options["counts_per_turn"] or span
        turned = np.append(values[-1], values) / (SIXTEENTHS * counts)
        places = np.arange(count + 1) / count
        cycles = counts / span

        def function(x: np.ndarray[Any, np.dtype[np.float64]]) -> Any:
            return np.interp(x % 1.0, places, turned)

        table = ReadTable(
            "output", cycles, function, count, 1.0 / (SIXTEENTHS * counts), forward=True
        )
        return function_model(
            [table], path, self, lambda at: np.asarray(function(at / TURN * cycles))
        )
