"""Models of Bokeh as its documents hold them: plain values that its script in the page reads.

A page of many runs has hundreds of models. Made one by one as objects of Bokeh's own classes and
checked, they take longer than the statistics of the report; they are written here as
Bokeh would write them, and a test lets Bokeh read and check every chart.
"""

from __future__ import annotations

import base64
import gzip
from collections.abc import Iterable, Mapping
from itertools import count
from typing import Any

import numpy as np

#: A model with its kind, identity and attributes.
Model = dict[str, Any]

_identities = count(1)


def bokeh_model(kind: str, **attributes: Any) -> Model:
    """A new model; what is not named keeps Bokeh's default."""
    return {"type": "object", "name": kind, "id": f"p{next(_identities)}", "attributes": attributes}


def bokeh_reference(made: Model) -> dict[str, str]:
    """A model that stands before this place in the document, named again."""
    return {"id": made["id"]}


def bokeh_field(column: str) -> dict[str, str]:
    """A property of marks that takes its values from a column."""
    return {"type": "field", "field": column}


def bokeh_value(same: Any) -> dict[str, Any]:
    """A property of marks that is the same for all."""
    return {"type": "value", "value": same}


def bokeh_columns(data: Mapping[str, Iterable[Any]]) -> Model:
    """A source of columns: arrays as bytes, texts as lists."""
    entries = [
        [name, _written(some) if isinstance(some, np.ndarray) else list(some)]
        for name, some in data.items()
    ]
    return bokeh_model("ColumnDataSource", data={"type": "map", "entries": entries})


def _written(array: np.ndarray[Any, Any]) -> dict[str, Any]:
    little = array.astype(array.dtype.newbyteorder("<"), copy=False)
    # Level and time as Bokeh's: the same figures are the same bytes.
    packed = gzip.compress(little.tobytes(), 9, mtime=1)
    return {
        "type": "ndarray",
        "array": {"type": "bytes", "data": base64.b64encode(packed).decode("ascii")},
        "shape": list(array.shape),
        "dtype": array.dtype.name,
        "order": "little",
    }
