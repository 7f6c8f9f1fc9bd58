"""What the folders above a file say of it: ``unit=a/run=3/data.parquet``, as Hive lays it out."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Final
from urllib.parse import unquote

__all__ = ["partition_keys", "partition_name"]

#: What stands for no value.
_NOTHING: Final = "__HIVE_DEFAULT_PARTITION__"


def partition_keys(path: str | PathLike[str]) -> dict[str, str]:
    """Keys and values of the folders right above a file, the outermost first.

    Examples
    --------
    >>> partition_keys("cells/unit=a%201/run=3/data.parquet")
    {'unit': 'a 1', 'run': '3'}
    >>> partition_keys("cells/data.parquet")
    {}
    """
    pairs = (folder.partition("=") for folder in _folders(path))
    return {unquote(key): unquote(value) for key, _, value in pairs if value != _NOTHING}


def partition_name(path: str | PathLike[str]) -> str:
    """The name of a file, with the folders that tell it from others of this name.

    Examples
    --------
    >>> partition_name("cells/unit=a/run=3/data.parquet"), partition_name("cells/a.csv")
    ('unit=a/run=3/data.parquet', 'a.csv')
    """
    return "/".join([*_folders(path), Path(path).name])


def _folders(path: str | PathLike[str]) -> list[str]:
    found: list[str] = []
    for folder in reversed(Path(path).parts[:-1]):
        key, equals, _ = folder.partition("=")
        if not key or not equals:
            break
        found.insert(0, folder)
    return found
