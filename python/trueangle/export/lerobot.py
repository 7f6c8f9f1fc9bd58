"""LeRobot: the calibration of an exoskeleton's Hall sensors, one joint."""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.files import FileKind
from .channelform import ChannelTarget, ellipse_of, made_of_channels, model_of_channels
from .pattern import TurnPattern
from .reading import table_error
from .target import CommentBlock, Made, Option

#: Full scale of the converter, and the middle that is subtracted first.
_FULL: Final = 4095
_MIDDLE: Final = _FULL / 2


class LeRobot(ChannelTarget):
    """Target ``lerobot``: ``center_fit`` and ``T`` of a joint of ``ExoskeletonCalibration``.

    ``z = T ((cosine, sine) - 2047.5 - center)``; the angle is ``zero_offset - atan2(z1, z0)``.
    """

    name = "lerobot"
    what = "the calibration of a joint of LeRobot's exoskeleton (JSON)"
    kind: ClassVar[FileKind] = FileKind("a calibration of LeRobot", (".json", ".txt"))
    unknown = (
        "LeRobot's angle is minus the phase of the channels, about the zero pose: hold the joint "
        "there and set zero_offset"
    )
    options = {
        "joint": Option(str, "joint", "name of the joint in the file"),
        "side": Option(str, "", "of the arm"),
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        channels = self.channels(pattern)
        _, _, per_cosine, per_sine, slope, _ = channels.constants
        content = {
            "version": 2,
            "side": options["side"],
            "adc_max": _FULL,
            "joints": [
                {
                    "name": options["joint"],
                    "center_fit": [
                        channels.offset_cosine - _MIDDLE,
                        channels.offset_sine - _MIDDLE,
                    ],
                    "T": [[per_cosine, 0.0], [-slope * per_cosine, per_sine]],
                    "zero_offset": 0.0,
                }
            ],
        }

        def text(header: CommentBlock) -> str:
            return json.dumps(content, indent=2) + "\n"

        decode = ellipse_of(channels)
        return made_of_channels(pattern, text, decode, decode, entries=7)

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        try:
            joints = json.loads(text)["joints"]
            (joint,) = [j for j in joints if len(joints) == 1 or j["name"] == options["joint"]]
            x, y = (float(v) + _MIDDLE for v in joint["center_fit"])
            (a, b), (c, d) = ((float(v) for v in row) for row in joint["T"])
            # Columns of the inverse are the cosine's and the sine's way round the ellipse.
            along, across = complex(d, -c) / (a * d - b * c), complex(-b, a) / (a * d - b * c)
        except (KeyError, TypeError, ValueError, ZeroDivisionError):
            raise table_error(
                path, f"is no calibration with one joint, or with the joint {options['joint']!r}"
            ) from None
        z1, image = 0.5 * (along - 1j * across), 0.5 * (along + 1j * across)
        # Counted from where the cosine is at its top.
        turn = cmath.exp(-1j * cmath.phase(z1 + image.conjugate()))
        along = z1 * turn + (image / turn).conjugate()
        across = z1 * turn - (image / turn).conjugate()
        return model_of_channels(
            Channels(
                offset_sine=y,
                offset_cosine=x,
                amplitude=abs(along),
                gain_ratio=abs(across) / abs(along),
                phase_deg=math.degrees(cmath.phase(across)),
                direction=-1,
                period=360.0,
            )
        )
