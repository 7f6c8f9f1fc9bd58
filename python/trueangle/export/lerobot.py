"""LeRobot: the calibration of an exoskeleton's Hall sensors, one joint."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, ClassVar, Final

from ..errors import FileError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.files import FileKind
from .channelform import ChannelTarget, ellipse_of, made_of_channels, model_of_channels
from .pattern import TurnPattern
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
            # The inverse has the way of the cosine and that of the sine round the ellipse.
            size = a * d - b * c
            ellipse = complex(x, y), complex(d, b) / size, complex(a, -c) / size
        except (KeyError, TypeError, ValueError, ZeroDivisionError):
            raise FileError(
                path, f"is no calibration with one joint, or with the joint {options['joint']!r}"
            ) from None
        return model_of_channels(Channels.of_amplitudes(*ellipse, direction=-1, period=360.0))
