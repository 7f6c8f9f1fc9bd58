"""Kinds of files that are written, and the endings that name them."""

from __future__ import annotations

import re
from collections.abc import Mapping
from os import PathLike
from pathlib import Path
from typing import Final, NamedTuple

from ...errors import FileError
from ..suggestions import listed_names

#: Endings that promise a format, by its name: a file of another must not bear them. Those of
#: logs are declared by their formats.
_FORMATS: Final[dict[str, tuple[str, ...]]] = {
    "JSON": (".json",),
    "JSON lines": (".jsonl", ".ndjson"),
    "TOML": (".toml",),
    "YAML": (".yaml", ".yml"),
    "XML": (".xml",),
    "HTML": (".html", ".htm"),
    "PDF": (".pdf",),
    "a text document": (".doc", ".docx", ".odt", ".rtf"),
    "a spreadsheet": (".xls", ".xlsx", ".xlsm", ".ods"),
    "PNG": (".png",),
    "JPEG": (".jpg", ".jpeg"),
    "SVG": (".svg",),
    "GIF": (".gif",),
    "WebP": (".webp",),
    "TIFF": (".tif", ".tiff"),
    "BMP": (".bmp",),
    "PostScript": (".ps", ".eps"),
    "Markdown": (".md",),
    "a compressed file": (".gz", ".zip", ".bz2", ".xz", ".zst", ".lz4", ".7z", ".tar", ".tgz"),
    "a database": (".db", ".sqlite", ".sqlite3"),
    "a functional mock-up unit": (".fmu",),
    "a pickle": (".pkl", ".pickle"),
    "C": (".c", ".h", ".cpp", ".hpp"),
    "Rust": (".rs",),
    "Python": (".py", ".ipynb"),
}

#: Endings of logs by what each is called.
_LOGS: Final[dict[str, tuple[str, ...]]] = {}


def declare_endings(promises: Mapping[str, tuple[str, ...]]) -> None:
    """Take in the endings of a format of logs, by the name that each promises."""
    for name, endings in promises.items():
        _LOGS[name] = tuple(dict.fromkeys((*_LOGS.get(name, ()), *endings)))


def log_endings() -> tuple[str, ...]:
    """Endings of the files that are read from a folder among the inputs."""
    return tuple(ending for endings in _LOGS.values() for ending in endings)


def ending_of(path: str | PathLike[str]) -> str:
    """The ending of a name in small letters, of both parts where it is that of a packed log.

    Examples
    --------
    >>> ending_of("a.b.CSV"), ending_of("joint.json.gz")
    ('.csv', '.gz')
    """
    named = Path(path)
    both = "".join(named.suffixes[-2:]).lower()
    return both if both in log_endings() else named.suffix.lower()


class FileKind(NamedTuple):
    """A kind of file: what it is called, and the endings it may bear.

    A name without an ending fits every kind.

    Examples
    --------
    >>> MODEL.check("joint.json"), MODEL.check("joint")
    (None, None)
    >>> MODEL.check("joint.mdl")
    Traceback (most recent call last):
    ...
    trueangle.errors.FileError: joint.mdl: the ending .mdl is not that of a model (JSON): .json; \
name it joint.json
    >>> MODEL.check("joint.csv")
    Traceback (most recent call last):
    ...
    trueangle.errors.FileError: joint.csv: the ending .csv means CSV, but what is written is \
a model (JSON); name it joint.json
    """

    what: str
    endings: tuple[str, ...]

    def check(self, path: str | PathLike[str]) -> None:
        """Refuse an ending that is none of these.

        Raises
        ------
        FileError
        """
        better = self.fitting(path)
        if better != Path(path):
            promised = promised_format(path)
            why = (
                f"is not that of {self.what}: {listed_names(self.endings)}"
                if promised is None
                else f"means {promised}, but what is written is {self.what}"
            )
            raise FileError(path, f"the ending {ending_of(path)} {why}; name it {better}")

    def fitting(self, path: str | PathLike[str]) -> Path:
        """The name, with an ending of this kind in place of another."""
        named, ending = Path(path), ending_of(path)
        if not ending or ending in self.endings:
            return named
        return named.with_name(named.name[: -len(ending)] + self.endings[0])


def kind_of_log(path: str | PathLike[str]) -> FileKind:
    """What a corrected copy of a log is: of the log's own format.

    Examples
    --------
    >>> kind_of_log("a.hdf5").what
    'HDF5, as the log is'
    """
    ending = ending_of(path)
    for name, endings in _LOGS.items():
        if ending in endings and name:
            own_first = dict.fromkeys((ending, *endings))
            return FileKind(f"{name}, as the log is", tuple(own_first))
    texts = [entry for entry in log_endings() if entry.startswith((".csv", ".tsv", ".tab", ".txt"))]
    own = [ending] if promised_format(path) is None else []
    return FileKind("text, as the log is", (*own, *texts))


def promised_format(path: str | PathLike[str]) -> str | None:
    """Name of the format that the ending of ``path`` promises, if it does."""
    ending = ending_of(path)
    known = {**_LOGS, **_FORMATS}.items()
    return next((name for name, endings in known if name and ending in endings), None)


MODEL: Final = FileKind("a model (JSON)", (".json",))
FLEET: Final = FileKind("a fleet (JSON)", (".json",))
SIMULATION: Final = FileKind("a simulation (TOML)", (".toml",))
#: What a simulator takes, by the ending.
SENSOR: Final = FileKind("a sensor of a simulator (MJCF or FMU)", (".xml", ".fmu"))
RUNS: Final = FileKind("a table of runs (CSV)", (".csv", ".txt"))
PAGE: Final = FileKind("a report (HTML)", (".html", ".htm"))
PDF: Final = FileKind("a report (PDF)", (".pdf",))
#: What a picture is written as, by the ending.
PICTURE: Final = FileKind("a picture (PNG, SVG or PDF)", (".png", ".svg", ".pdf"))
CERTIFICATE: Final = FileKind("a certificate (PDF)", (".pdf",))
#: What `Report.save` writes, by the ending.
REPORT: Final = FileKind("a report (HTML or PDF)", (*PAGE.endings, *PDF.endings))

#: Files of this package by the format that they state, or the name of their first table: what each
#: is, and what uses it.
_OWN: Final = {
    "model": ("a correction model", 'ta.correct_logs("LOG", model="{}", output="OUT")'),
    "robot": (
        "the correction models of a robot",
        'ta.correct_logs("LOG", model="{}", output="OUT")',
    ),
    "fleet": ("a fleet", 'ta.fit("RUNS", prior="{}")'),
    "[limits": ("a file of limits", 'ta.plan(after="RUNS", limits="{}")'),
    "[[joint": ("a robot file", 'ta.diagnose("RUNS", robot="{}")'),
    "[robot": ("a robot file", 'ta.diagnose("RUNS", robot="{}")'),
}
_SIMULATION: Final = ("a simulation", 'ta.diagnose("RUNS", simulation="{}")')
#: A format, or the first table of TOML with a key.
_STATED: Final = re.compile(
    r'\A\s*\{\s*"format":\s*"trueangle-(model|robot|fleet)"'
    r"|\A(?:\s*#.*\n)*\s*(?:(\[limits|\[\[joint|\[robot)"
    r"|\[joint|\[\[(?:shaft|bearing|head|harmonic|effect|run)|\[noise)\].*\n(?:\s*[#[].*\n)*\s*\w+\s*="
)


def refuse_own(path: str | PathLike[str], head: bytes, wanted: str) -> None:
    """Refuse another file of this package in place of ``wanted``, by the first bytes of a file.

    Raises
    ------
    FileError
    """
    found = _STATED.match(head.decode("utf-8", "replace").replace("\r", ""))
    if found:
        what, use = _OWN.get(found[1] or found[2], _SIMULATION)
        if what != wanted:
            raise FileError(path, f"is {what}, not {wanted}; it is used by `{use.format(path)}`")
