"""The PDF of a certificate, set by typst; figures are vectors."""

from __future__ import annotations

import io
import json
import os
import tempfile
from os import PathLike
from pathlib import Path
from typing import Any, Final

from ..errors import MissingExtraError
from ..support.angles import ARCSEC_PER_TURN
from ..support.files import CERTIFICATE, check_output, external_output, read_whole
from .language import certificate_texts, note_in

__all__ = ["certificate_pictures", "lay_out", "typeset_certificate", "write_pdf"]

#: Part of the span of the errors below which bars of U are not seen beside them.
_SMALL: Final = 0.04

#: Largest logo.
_MOST_BYTES: Final = 4 << 20

_TEMPLATE: Final = Path(__file__).parent / "certificate.typ"


def write_pdf(content: dict[str, Any], path: str | PathLike[str], logo: str | None = None) -> None:
    """Typeset ``content`` and write it; see `Certificate.save`."""
    hashes = [entry["sha256"] for entry in content["provenance"]["inputs"]]
    target = check_output(path, CERTIFICATE, hashes=hashes)
    pdf = typeset_certificate(content, logo)
    with external_output(target) as printed:
        printed.write_bytes(pdf)


def typeset_certificate(content: dict[str, Any], logo: str | None = None) -> bytes:
    """The certificate as a PDF/A-2b document."""
    return bytes(_compiled(content, logo, format="pdf", pdf_standards="a-2b"))


def certificate_pictures(content: dict[str, Any], dots_per_inch: float = 110.0) -> list[bytes]:
    """Its pages as PNG, to be shown where a PDF cannot be."""
    made = _compiled(content, None, format="png", ppi=dots_per_inch)
    return made if isinstance(made, list) else [made]


def lay_out(content: dict[str, Any], folder: Path, logo: str | None = None) -> Path:
    """Write what is typeset into ``folder``; the file that the typesetter takes."""
    said = certificate_texts(content["language"])
    rows = content["positions"]
    span = max(r["error_arcsec"] for r in rows) - min(r["error_arcsec"] for r in rows)
    small = max(r["expanded_arcsec"] for r in rows) < _SMALL * span
    picture = None if logo is None else Path(f"logo{Path(logo).suffix.lower()}")
    if logo is not None and picture is not None:
        (folder / picture).write_bytes(read_whole(logo, _MOST_BYTES, "a logo"))
    shown = content | {"small_u": small, "logo": None if picture is None else str(picture)}
    shown["notes"] = [note_in(content["language"], note) for note in content["notes"]]
    (folder / "certificate.typ").write_bytes(_TEMPLATE.read_bytes())
    (folder / "content.json").write_text(json.dumps(shown, allow_nan=False), "utf-8")
    (folder / "texts.json").write_text(json.dumps(said), "utf-8")
    (folder / "errors.svg").write_bytes(_picture(content, said, small))
    return folder / "certificate.typ"


def _compiled(content: dict[str, Any], logo: str | None, **how: Any) -> Any:
    try:
        import typst
    except ModuleNotFoundError:
        raise MissingExtraError(
            "certificates need typst: pip install 'trueangle[certificate]'"
        ) from None
    # typst reads below one folder only: its input stands in one of its own.
    with tempfile.TemporaryDirectory(prefix="trueangle-certificate-") as folder:
        file = lay_out(content, Path(folder), logo)
        return typst.compile(os.fspath(file), root=folder, ignore_system_fonts=True, **how)


def _picture(content: dict[str, Any], said: dict[str, Any], small: bool) -> bytes:
    """Value and U at every position as SVG; what would be too small to see on axes of its own."""
    from ..plots.certified import certified_errors, certified_pair

    shown = content["errors_in"]
    counts = shown["per_arcsec"] * ARCSEC_PER_TURN
    unit: Any = counts if shown["unit"] == "count" else shown["unit"]
    rows, left = content["positions"], content["as_left"]
    below = None if left is None else left["positions"]
    if below is None and small:
        below = [row | {"error_arcsec": 0.0} for row in rows]
    axes = (
        [certified_errors(rows, errors_in=unit)]
        if below is None
        else certified_pair(rows, below, errors_in=unit)
    )
    result = said["result"]
    names = [result["axis_error"], "U / #unit" if left is None else result["axis_left"]]
    for ax, name in zip(axes, names, strict=False):
        ax.set_ylabel(name.replace("#unit", shown["unit"]))
    axes[-1].set_xlabel(result["axis"])
    figure = axes[0].get_figure(root=True)
    assert figure is not None
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg")
    from matplotlib import pyplot

    pyplot.close(figure)
    return buffer.getvalue()
