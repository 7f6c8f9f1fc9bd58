"""Mini Cheetah motor controllers: the ``offset_lut`` of the position sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

from ..errors import FileError
from ..model.model import HarmonicModel
from ..support.files import FileKind
from .codetext import number_rows
from .pattern import TurnPattern
from .target import CommentBlock, Made, Option
from .tinymovr import Tinymovr, Whole

_ENTRIES = 128
_BITS = 16


class MiniCheetah(Tinymovr):
    """Target ``minicheetah``: ``offset_lut[128]``, whole ticks of 2^16 a turn.

    ``count = raw + off_1 + ((off_2 - off_1) * (raw & 511) >> 9)``: the arithmetic of `Tinymovr`
    in 16 bits.
    """

    name = "minicheetah"
    what = "the offset_lut of a Mini Cheetah motor controller"
    kind: ClassVar[FileKind] = FileKind("a C source for the motor controller", (".h", ".c", ".txt"))
    unknown = (
        "the firmware's own calibration fills the table and keeps it in words 6 to 133 of its "
        "settings in flash; if the table is changed otherwise, the electrical zero is found again"
    )
    options: ClassVar[dict[str, Option]] = {}

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        made = super().make(pattern, {"bits": _BITS, "entries": _ENTRIES})
        return replace(made, bits=_BITS)

    def write(self, table: Whole, bits: int, header: CommentBlock) -> str:
        own = (
            "offset_lut of the position sensor: ticks of 2^16 a turn that are added to the raw "
            "reading; entry k belongs to the reading 512 k."
        )
        lines = header.comment("// ", own)
        values = number_rows([str(int(value)) for value in table])
        return "\n".join([*lines, f"int offset_lut[{_ENTRIES}] = {{", values, "};", ""])

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        model = super().read(text, path, {"bits": _BITS})
        entries = 0 if model.fit is None else model.fit.samples
        if entries != _ENTRIES:
            raise FileError(path, f"holds {entries} numbers: offset_lut has {_ENTRIES}")
        return model
