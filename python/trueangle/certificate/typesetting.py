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
from ..support.files import CERTIFICATE, check_output, published

__all__ = ["pictures", "typeset", "write_pdf"]

_TEMPLATE: Final = Path(__file__).parent / "certificate.typ"


def write_pdf(content: dict[str, Any], path: str | PathLike[str]) -> None:
    """Typeset ``content`` and write it; see `Certificate.save`."""
    hashes = [entry["sha256"] for entry in content["provenance"]["inputs"]]
    target = check_output(path, CERTIFICATE, hashes=hashes)
    pdf = typeset(content)
    with published(target) as printed:
        printed.write_bytes(pdf)


def typeset(content: dict[str, Any]) -> bytes:
    """The certificate as a PDF/A-2b document."""
    return bytes(_compiled(content, format="pdf", pdf_standards="a-2b"))


def pictures(content: dict[str, Any], dots_per_inch: float = 110.0) -> list[bytes]:
    """Its pages as PNG, to be shown where a PDF cannot be."""
    made = _compiled(content, format="png", ppi=dots_per_inch)
    return made if isinstance(made, list) else [made]


def _compiled(content: dict[str, Any], **how: Any) -> Any:
    try:
        import typst
    except ModuleNotFoundError:
        raise MissingExtraError(
            "certificates need typst: pip install 'trueangle[certificate]'"
        ) from None
    picture = _picture(content)
    # typst reads below one folder only: its input stands in one of its own.
    with tempfile.TemporaryDirectory(prefix="trueangle-certificate-") as folder:
        place = Path(folder)
        (place / "certificate.typ").write_bytes(_TEMPLATE.read_bytes())
        (place / "content.json").write_text(json.dumps(content, allow_nan=False), "utf-8")
        (place / "errors.svg").write_bytes(picture)
        return typst.compile(
            os.fspath(place / "certificate.typ"), root=folder, ignore_system_fonts=True, **how
        )


def _picture(content: dict[str, Any]) -> bytes:
    """Value and U at every position as SVG."""
    from ..plots.certified import certified_errors

    shown = content["errors_in"]
    counts = shown["per_arcsec"] * ARCSEC_PER_TURN
    figure = certified_errors(
        content["positions"], errors_in=counts if shown["unit"] == "count" else shown["unit"]
    ).get_figure(root=True)
    assert figure is not None
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg")
    from matplotlib import pyplot

    pyplot.close(figure)
    return buffer.getvalue()
