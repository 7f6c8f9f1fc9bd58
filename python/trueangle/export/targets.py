"""All targets: one file and one line each."""

from __future__ import annotations

from ..errors import ArgumentError
from ..support.suggestions import did_you_mean
from .admt4000 import Admt4000
from .ax2000 import Ax2000
from .ax5000 import Ax5000
from .c import CHeader
from .csvtable import CsvTable
from .fmu import Fmu
from .klipper import Klipper
from .lerobot import LeRobot
from .linuxcnc import LinuxCnc
from .mechaduino import Mechaduino
from .minicheetah import MiniCheetah
from .moteus import Moteus
from .mujoco import MuJoCo
from .pmac import Pmac
from .rust import RustModule
from .siemens840d import Siemens840d
from .simplefoc import SimpleFoc
from .target import Target
from .tinymovr import Tinymovr
from .twincat import TwinCat
from .vesc import Vesc

#: Every target by its name.
TARGETS: dict[str, Target] = {
    target.name: target
    for target in (
        CHeader(),
        RustModule(),
        CsvTable(),
        SimpleFoc(),
        Moteus(),
        LinuxCnc(),
        TwinCat(),
        Klipper(),
        Admt4000(),
        Mechaduino(),
        Tinymovr(),
        MiniCheetah(),
        Siemens840d(),
        Pmac(),
        Vesc(),
        LeRobot(),
        Ax2000(),
        Ax5000(),
        Fmu(),
        MuJoCo(),
    )
}


def export_target(name: str) -> Target:
    """The target of a name.

    Raises
    ------
    ArgumentError
        There is none.
    """
    if name not in TARGETS:
        raise ArgumentError(
            f"there is no target {name!r}; the targets are "
            f"{', '.join(TARGETS)}{did_you_mean(name, TARGETS)}"
        )
    return TARGETS[name]
