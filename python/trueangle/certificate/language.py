"""Texts of certificates: one file a language in the folder beside this module."""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any, Final

__all__ = ["LANGUAGES", "texts"]

_FOLDER: Final = Path(__file__).parent / "texts"

#: Languages that there are texts in.
LANGUAGES: Final = tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def texts(language: str) -> dict[str, Any]:
    """All texts of a language, by the parts of a certificate."""
    return tomllib.loads((_FOLDER / f"{language}.toml").read_text("utf-8"))
