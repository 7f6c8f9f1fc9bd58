"""Small Excel files, written by hand: what a spreadsheet stores of a table, and nothing else."""

import sys
import zipfile

import pytest

_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_RELATION = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
#: Styles: a number, a date with a time, an elapsed time, a time of the day.
_FORMATS = ("0", "yyyy-mm-dd hh:mm:ss.000", "[h]:mm:ss", "hh:mm:ss")
DATE, ELAPSED, CLOCK = 1, 2, 3


def needs_library(ending):
    """Skip where what reads files of this ending is not installed."""
    if ending.endswith("zst") and sys.version_info < (3, 14):
        pytest.importorskip("backports.zstd")
    if ending.endswith("xlsx"):
        pytest.importorskip("python_calamine")


def _cell(value, place):
    if value is None:
        return ""
    if isinstance(value, tuple):  # style and number
        return f'<c r="{place}" s="{value[0]}"><v>{value[1]}</v></c>'
    if isinstance(value, str):
        return f'<c r="{place}" t="inlineStr"><is><t>{value}</t></is></c>'
    return f'<c r="{place}"><v>{value}</v></c>'


def _rows(rows):
    for number, row in enumerate(rows, 1):
        cells = "".join(_cell(value, f"{chr(65 + i)}{number}") for i, value in enumerate(row))
        yield f'<row r="{number}">{cells}</row>'


def _relations(targets):
    entries = (
        f'<Relationship Id="r{i}" Type="{_RELATION}/{k}" Target="{target}"/>'
        for i, (k, target) in enumerate(targets)
    )
    return f'<Relationships xmlns="{_PACKAGE}/relationships">{"".join(entries)}</Relationships>'


def write_workbook(path, sheets):
    """Write rows of cells by the name of their sheet; None is an empty cell."""
    names = "".join(
        f'<sheet name="{name}" sheetId="{i + 1}" r:id="r{i}"/>' for i, name in enumerate(sheets)
    )
    formats = "".join(
        f'<numFmt numFmtId="{170 + i}" formatCode="{code}"/>' for i, code in enumerate(_FORMATS)
    )
    styles = "".join(f'<xf numFmtId="{170 + i}"/>' for i in range(len(_FORMATS)))
    held = [("worksheet", f"worksheets/sheet{i}.xml") for i in range(len(sheets))]
    parts = {
        "[Content_Types].xml": f'<Types xmlns="{_PACKAGE}/content-types"/>',
        "_rels/.rels": _relations([("officeDocument", "xl/workbook.xml")]),
        "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_RELATION}"><sheets>{names}'
        "</sheets></workbook>",
        "xl/_rels/workbook.xml.rels": _relations([*held, ("styles", "styles.xml")]),
        "xl/styles.xml": f'<styleSheet xmlns="{_MAIN}"><numFmts>{formats}</numFmts>'
        f"<cellXfs>{styles}</cellXfs></styleSheet>",
    }
    for (_kind, place), rows in zip(held, sheets.values(), strict=True):
        parts[f"xl/{place}"] = (
            f'<worksheet xmlns="{_MAIN}"><sheetData>{"".join(_rows(rows))}</sheetData></worksheet>'
        )
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, text)
