"""The PDF of a certificate, set by typst; its figure, of vectors, by matplotlib."""

from __future__ import annotations

import io
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..errors import MissingExtraError
from ..plots import palette
from ..plots.canvas import described, new_axes, new_figure, page_pictures, turn_axis
from ..support.angles import ARCSEC_PER_TURN
from ..support.display_units import ErrorsIn, error_unit, significant_digits, sine_of_rms
from ..support.files import CERTIFICATE, check_output, external_output, read_whole
from .language import certificate_texts, note_in, translated

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_TEMPLATE: Final = Path(__file__).parent / "certificate.typ"


def write_pdf(content: dict[str, Any], path: str | PathLike[str], logo: str | None = None) -> None:
    """Typeset ``content`` and write it; see `Certificate.save`."""
    hashes = [entry["sha256"] for entry in content["provenance"]["inputs"]]
    target = check_output(path, CERTIFICATE, hashes=hashes)
    with external_output(target) as printed:
        printed.write_bytes(typeset_certificate(content, logo))


def typeset_certificate(content: dict[str, Any], logo: str | None = None) -> bytes:
    """The certificate as a PDF/A-2b document."""
    return bytes(_compiled(content, logo, format="pdf", pdf_standards="a-2b"))


def certificate_pictures(content: dict[str, Any], dots_per_inch: float = 110.0) -> list[bytes]:
    """Its pages as PNG, to be shown where a PDF cannot be."""
    made = _compiled(content, None, format="png", ppi=dots_per_inch)
    return made if isinstance(made, list) else [made]


def lay_out(content: dict[str, Any], folder: Path, logo: str | None = None) -> Path:
    """Write what is typeset into ``folder``; the file that the typesetter takes."""
    language = content["language"]
    said = certificate_texts(language)
    rows = content["positions"]
    span = max(r["error_arcsec"] for r in rows) - min(r["error_arcsec"] for r in rows)
    # Part of the span of the errors below which bars of U at them are too small to see.
    small = max(r["expanded_arcsec"] for r in rows) < 0.04 * span
    picture = None if logo is None else Path(f"logo{Path(logo).suffix.lower()}")
    if logo is not None and picture is not None:
        (folder / picture).write_bytes(read_whole(logo, 4 << 20, "a logo"))
    shown = content | {"small_u": small, "logo": None if picture is None else str(picture)}
    shown["notes"] = [note_in(language, note) for note in content["notes"]]
    shown["data_faults"] = [note_in(language, f"{f['says']}.") for f in content["data_faults"]]
    cannot = [
        f"{translated(entry['what'], language)} ({translated(entry['because'], language)})"
        for entry in content["coverage"]["cannot"]
    ]
    shown["coverage"] = content["coverage"] | {"cannot": cannot}
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
    # typst reads below one folder only: its input gets a separate one.
    with tempfile.TemporaryDirectory(prefix="trueangle-certificate-") as folder:
        file = lay_out(content, Path(folder), logo)
        return typst.compile(os.fspath(file), root=folder, ignore_system_fonts=True, **how)


def _picture(content: dict[str, Any], said: dict[str, Any], small: bool) -> bytes:
    """Value and U at every position as SVG; U on separate axes where it is too small to see."""
    shown = content["errors_in"]
    counts = shown["per_arcsec"] * ARCSEC_PER_TURN
    unit: Any = counts if shown["unit"] == "count" else shown["unit"]
    rows, left = content["positions"], content["as_left"]
    parts = [rows] if left is None else [rows, left["positions"]]
    if left is None and small:
        parts.append([row | {"error_arcsec": 0.0} for row in rows])
    # One below the other, each with its own scale.
    with page_pictures(1.0):
        figure, axes = new_figure(len(parts), 1, 7.5, (2.8, 4.6)[len(parts) - 1], sharey=False)
    result = said["result"]
    names = [result["axis_error"], "U / #unit" if left is None else result["axis_left"]]
    for ax, some, name in zip(axes, parts, names, strict=False):
        certified_errors(some, ax, unit)
        ax.set_ylabel(name.replace("#unit", shown["unit"]))
        ax.set_xlabel("")
    axes[-1].set_xlabel(result["axis"])
    figure.align_ylabels()
    buffer = io.BytesIO()
    figure.savefig(buffer, format="svg")
    return buffer.getvalue()


def certified_errors(
    positions: Sequence[Mapping[str, float]],
    ax: Axes | None = None,
    errors_in: ErrorsIn = "auto",
) -> Axes:
    """Error at every nominal position with bars of its expanded uncertainty.

    Parameters
    ----------
    positions : sequence of mappings
        ``angle_deg, error_arcsec, expanded_arcsec``, as a certificate's content has them.
    ax : matplotlib Axes, optional
    errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
        Unit of the errors, as for summaries.

    Returns
    -------
    matplotlib Axes
    """
    ax = new_axes(ax, height=2.8)
    angle, error, expanded = (
        np.array([row[name] for row in positions])
        for name in ("angle_deg", "error_arcsec", "expanded_arcsec")
    )
    unit = error_unit(errors_in, sine_of_rms(float(np.std(error))))
    error, expanded = unit.per_arcsec * error, unit.per_arcsec * expanded
    ax.axhline(0.0, color=palette.MUTED, linewidth=0.8)
    ax.errorbar(
        angle,
        error,
        yerr=expanded,
        linestyle="none",
        marker="o",
        markersize=3.0,
        color=palette.AFTER,
        ecolor=palette.ink(ax),
        elinewidth=0.9,
        capsize=2.0,
    )
    margin = 0.02 * max(float(np.ptp(angle)), 1.0)
    turn_axis(ax, float(angle.min()) - margin, float(angle.max()) + margin)
    ax.set_xlabel("position / deg")
    ax.set_ylabel(f"error / {unit.name}")
    return described(
        ax,
        f"Error at {len(positions)} positions with expanded uncertainty, from "
        f"{significant_digits(float(error.min()))} to {significant_digits(float(error.max()))} "
        f"{unit.name}, "
        f"U at most {significant_digits(float(expanded.max()), 2)} {unit.name}.",
    )
