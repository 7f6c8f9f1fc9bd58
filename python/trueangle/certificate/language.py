"""Texts of certificates: one file a language in the folder next to this module."""

from __future__ import annotations

import re
import tomllib
from functools import lru_cache
from pathlib import Path
from typing import Any, Final

_FOLDER: Final = Path(__file__).parent / "texts"

#: Languages that there are texts in.
LANGUAGES: Final = tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))

#: The language that notes of a fit are written in.
_WRITTEN: Final = "en"

#: Values of notes that are words of their own or lists; others are one word, such as a number.
_WORDS: Final = frozenset(
    (
        "jump",
        "list",
        "names",
        "pairs",
        "rest",
        "runs",
        "shifts",
        "span",
        "what",
        "where",
        "which",
        "why",
    )
)

_ONE: Final = r"[^\s,;()]+"

#: A place of a text that holds a value, and a decimal number.
_PLACE: Final = re.compile(r"#(\w+)")
_DECIMAL: Final = re.compile(r"(?<![\w.#-])(-?\d+)\.(\d+)(?![\w.])")


def certificate_texts(language: str) -> dict[str, Any]:
    """All texts of a language, by the parts of a certificate."""
    return tomllib.loads((_FOLDER / f"{language}.toml").read_text("utf-8"))


def note_in(language: str, note: str) -> str:
    """A note of a fit in a language; as it is where no text of ``[notes]`` has its words.

    Examples
    --------
    >>> note_in("de", "2 outliers rejected: reading 7 of run a, reading 9 of run b.")
    '2 Ausreißer ausgeschlossen: Ablesung 7 des Laufs a, Ablesung 9 des Laufs b.'
    """
    found = translated(note.removesuffix("."), language)
    return f"{found[:1].upper()}{found[1:]}{'.' if note.endswith('.') else ''}"


def translated(note: str, language: str) -> str:
    """A sentence or a part of one; of lists every entry."""
    if language == _WRITTEN:
        return note
    known = _notes(language)
    for pattern, text in known:
        match = pattern.fullmatch(note)
        if match is not None:
            values = {name: translated(part, language) for name, part in match.groupdict().items()}
            return "".join(
                values.get(part, part) if i % 2 else part
                for i, part in enumerate(_PLACE.split(text))
            )
    if ", " in note:
        return ", ".join(translated(part, language) for part in note.split(", "))
    return _DECIMAL.sub(rf"\1{certificate_texts(language)['decimal_mark']}\2", note)


@lru_cache(maxsize=8)
def _notes(language: str) -> list[tuple[re.Pattern[str], str]]:
    """Patterns of the notes as they are written, and their texts in a language."""
    written, told = certificate_texts(_WRITTEN)["notes"], certificate_texts(language)["notes"]
    found = []
    for name, text in written.items():
        parts = _PLACE.split(text)
        pattern = "".join(
            re.escape(part) if i % 2 == 0 else f"(?P<{part}>{'.+?' if part in _WORDS else _ONE})"
            for i, part in enumerate(parts)
        )
        found.append((re.compile(pattern, re.IGNORECASE | re.DOTALL), told[name]))
    return found
