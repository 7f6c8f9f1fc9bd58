"""Data with labels: series of pandas and polars, arrays of xarray, taken apart and put together.

None of these libraries is imported: whoever passes such data has done so. narwhals would replace
two of the four functions below (series of pandas and polars); it knows no xarray and no index of a
frame, and would be one more dependency of a package that needs numpy alone.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

#: Puts the labels of the data taken apart on results of their shape.
PutBack: TypeAlias = Callable[[NDArray[Any]], Any]


def take_apart(data: Any) -> tuple[Any, PutBack | None]:
    """The numbers of labelled data, and what makes such data of other numbers.

    Missing values are NaN, and anything else than such data is returned as it is.
    ``put_back(results)`` has the name, index, coordinates and attributes of ``data``.

    Examples
    --------
    >>> take_apart((1.0, 2.0))
    ((1.0, 2.0), None)
    """
    kind = type(data)
    library = kind.__module__.partition(".")[0]
    known = _KINDS.get((library, kind.__name__))
    return (data, None) if known is None else known(data)


def _of_pandas(series: Any) -> tuple[Any, PutBack]:
    def put_back(results: NDArray[Any]) -> Any:
        return type(series)(results, index=series.index, name=series.name)

    return _numbers(series), put_back


def _of_pandas_frame(frame: Any) -> tuple[Any, PutBack]:
    def put_back(results: NDArray[Any]) -> Any:
        return type(frame)(results, index=frame.index, columns=frame.columns)

    return _numbers(frame), put_back


def _numbers(data: Any) -> Any:
    """As numpy holds them; pandas' own types, which know missing values, as floats."""
    types = data.dtypes if hasattr(data, "columns") else [data.dtype]
    own = [kind for kind in types if not isinstance(kind, np.dtype)]
    if own and all(getattr(kind, "kind", "O") in "fiu" for kind in own):
        return data.to_numpy(dtype=np.float64, na_value=np.nan)
    return data.to_numpy()


def _of_polars(series: Any) -> tuple[Any, PutBack]:
    def put_back(results: NDArray[Any]) -> Any:
        return type(series)(series.name, results)

    return series.to_numpy(), put_back


def _of_xarray(array: Any) -> tuple[Any, PutBack]:
    def put_back(results: NDArray[Any]) -> Any:
        return array.copy(data=results)

    return np.asarray(array.data), put_back


_KINDS: dict[tuple[str, str], Callable[[Any], tuple[Any, PutBack]]] = {
    ("pandas", "Series"): _of_pandas,
    ("pandas", "DataFrame"): _of_pandas_frame,
    ("polars", "Series"): _of_polars,
    ("xarray", "DataArray"): _of_xarray,
}
