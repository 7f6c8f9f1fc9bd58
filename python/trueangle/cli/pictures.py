"""Pictures that commands write."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, TextIO, cast

from ..support.files import PICTURE, written_atomically

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def save_picture(drawn: Axes | Figure, path: str) -> None:
    """Write a picture whole or not at all, as its ending says (PNG where it says none)."""
    ending = Path(path).suffix.lower()
    kind = ending[1:] if ending in PICTURE.endings else "png"
    figure = drawn if hasattr(drawn, "savefig") else drawn.get_figure(root=True)
    assert figure is not None
    written = io.BytesIO()
    figure.savefig(written, format=kind)
    with written_atomically(path, kind=PICTURE) as file:
        cast(TextIO, file).buffer.write(written.getvalue())
