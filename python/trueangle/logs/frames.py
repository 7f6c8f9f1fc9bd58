"""`correct`: data in memory or in a stream, as arrays, tables and frames of any library."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from os import PathLike
from typing import Any, TypeAlias, overload

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, MissingExtraError
from ..model.model import HarmonicModel
from ..support.argumentkinds import told_kinds
from ..support.labelled import take_apart
from .joints import JointChannel, JointState, LogSettings, logged_joints

_DATA = "data"


#: What states how a joint, or the joints of a robot, are corrected.
_Models: TypeAlias = HarmonicModel | str | PathLike[str] | Mapping[str, Any]


@overload
def correct(
    data: NDArray[Any],
    model: _Models,
    *,
    column: str | Mapping[str, str] | None = None,
    signals: Mapping[str, Any] | None = None,
    unit: str | None = None,
    counts_per_turn: float | None = None,
    threads: int | None = None,
) -> NDArray[Any]: ...


@overload
def correct(
    data: Any,
    model: _Models,
    *,
    column: str | Mapping[str, str] | None = None,
    signals: Mapping[str, Any] | None = None,
    unit: str | None = None,
    counts_per_turn: float | None = None,
    threads: int | None = None,
) -> Any: ...


@told_kinds
def correct(
    data: Any,
    model: _Models,
    *,
    column: str | Mapping[str, str] | None = None,
    signals: Mapping[str, Any] | None = None,
    unit: str | None = None,
    counts_per_turn: float | None = None,
    threads: int | None = None,
) -> Any:
    """Data with the corrected angle of every joint as further columns, of the kind given.

    ::

        θ = θ_ind - ε(θ)

    Parameters
    ----------
    data : array or table
        A pyarrow Table, RecordBatch or RecordBatchReader; a polars DataFrame or LazyFrame;
        a pandas DataFrame; a Dask DataFrame; any object with the Arrow PyCapsule stream
        (``__arrow_c_stream__``), such as a relation of duckdb; an xarray Dataset; or a numpy
        or Dask array, a series of pandas or polars, or an xarray DataArray of angles in the
        model's unit, whose names, index and coordinates are kept.
    model : HarmonicModel, Robot, path of either, or mapping of joint names to models
        A robot knows the columns that it was fitted to; ``column`` and ``signals`` name others.
    column : str or mapping of joint names to str, optional
        The indicated angle; by default ``indicated_deg`` (``_rad``, ``_turn``, ``_count``),
        of a named joint ``JOINT_indicated_deg`` and the like.
    signals : mapping, optional
        Columns of the signals that terms of the model need.
    unit : {"deg", "rad", "turn", "count"}, optional
        Of the column; by default what its name ends in.
    counts_per_turn : float, optional
    threads : int, optional

    Returns
    -------
    Same kind as ``data``
        A new object; nothing is copied but what pandas must. Streams, lazy frames and Dask
        collections stay lazy: a stream gives a ``pyarrow.RecordBatchReader``. Nulls and NaN
        stay as they are. Arrow results carry the models' sha256 in their metadata.

    Raises
    ------
    ArgumentError
        ``data`` is of another kind; a Dask DataFrame or a polars LazyFrame with a model
        whose error does not repeat after one turn (its rows would have to come in order).
    FileError
        No such column, or it holds no numbers.

    Notes
    -----
    Batches of a stream, chunks of a table and blocks of a Dask array are taken in order:
    turns are counted over their borders for models that need it.

    Examples
    --------
    >>> from trueangle import Shaft
    >>> model = HarmonicModel([Shaft("output", 1, [1], [0.0], [0.5])], period=360.0)
    >>> correct(np.array([90.5, np.nan]), model).round(9)
    array([90., nan])
    """
    settings = LogSettings(
        logged_joints(model, column, signals), unit, counts_per_turn, threads=threads
    )
    for module, convert in _KINDS:
        # Only a library that is imported can have made the data.
        library = sys.modules.get(module)
        if library is not None:
            result = convert(library, data, settings)
            if result is not NotImplemented:
                return result
    values, put_back = take_apart(data)
    if put_back is not None:
        return put_back(_array_channel(settings).correct(np.asarray(values)))
    if isinstance(data, np.ndarray):
        return _array_channel(settings).correct(data)
    if hasattr(data, "__arrow_c_stream__"):
        return _stream(_pyarrow(), _pyarrow().RecordBatchReader.from_stream(data), settings)
    raise ArgumentError(
        "data must be an array or series, a pyarrow, polars, pandas, xarray or Dask table, or an "
        f"object with __arrow_c_stream__, got {type(data).__name__}"
    )


def _pyarrow() -> Any:
    try:
        import pyarrow
    except ModuleNotFoundError:
        raise MissingExtraError("Arrow streams need pyarrow: pip install 'trueangle[arrow]'") from (
            None
        )
    return pyarrow


def _from_pyarrow(pa: Any, data: Any, settings: LogSettings) -> Any:
    if isinstance(data, pa.RecordBatchReader):
        return _stream(pa, data, settings)
    if not isinstance(data, (pa.Table, pa.RecordBatch)):
        return NotImplemented
    from ..formats.arrowtables import add_corrected, corrected_schema

    channels = settings.channels(_DATA, data.schema.names)
    schema = corrected_schema(data.schema, channels, _DATA)
    return add_corrected(_DATA, data, channels, schema)


def _stream(pa: Any, reader: Any, settings: LogSettings) -> Any:
    from ..formats.arrowtables import add_corrected, corrected_schema

    channels = settings.channels(_DATA, reader.schema.names)
    schema = corrected_schema(reader.schema, channels, _DATA)

    def batches() -> Iterator[Any]:
        for batch in reader:
            yield add_corrected(_DATA, batch, channels, schema)

    return pa.RecordBatchReader.from_batches(schema, batches())


def _from_polars(pl: Any, data: Any, settings: LogSettings) -> Any:
    if isinstance(data, pl.LazyFrame):
        if settings.needs_order:
            raise ArgumentError(_OUT_OF_ORDER.format("a LazyFrame", "collect it first"))
        schema = data.collect_schema()
        channels = settings.channels(_DATA, schema.names())
        single = {c.angle.corrected: schema[c.angle.name] == pl.Float32 for c in channels}
        kinds = {name: pl.Float32 if s else pl.Float64 for name, s in single.items()}
        return data.map_batches(
            lambda frame: _from_polars(pl, frame, settings),
            schema={**schema, **kinds},
            streamable=True,
        )
    if not isinstance(data, pl.DataFrame):
        return NotImplemented
    added = []
    for channel in settings.channels(_DATA, data.columns):
        indicated = data[channel.angle.name]
        used = {signal: data[name].to_numpy() for signal, name in channel.signals.items()}
        values = pl.Series(channel.angle.corrected, channel.correct(indicated.to_numpy(), used))
        if indicated.null_count():
            values = values.set(indicated.is_null(), None)
        added.append(values)
    return data.with_columns(added)


def _from_pandas(pd: Any, data: Any, settings: LogSettings) -> Any:
    if not isinstance(data, pd.DataFrame):
        return NotImplemented
    added = {}
    for channel in settings.channels(_DATA, [str(name) for name in data.columns]):
        used = {signal: _numpy(data[name]) for signal, name in channel.signals.items()}
        corrected = channel.correct(_numpy(data[channel.angle.name]), used)
        dtype = data[channel.angle.name].dtype
        missing = data[channel.angle.name].isna()
        added[channel.angle.corrected] = pd.Series(corrected, index=data.index)
        if not isinstance(dtype, np.dtype) and missing.any():
            # Types of pandas that know NA keep it.
            kind = "Float32" if corrected.dtype == np.float32 else "Float64"
            if "pyarrow" in str(dtype):
                kind = "float[pyarrow]" if kind == "Float32" else "double[pyarrow]"
            added[channel.angle.corrected] = added[channel.angle.corrected].astype(kind)
            added[channel.angle.corrected][missing] = pd.NA
    return data.assign(**added)


def _numpy(series: Any) -> Any:
    if isinstance(series.dtype, np.dtype) and series.dtype.kind in "fiu":
        return series.to_numpy()
    return series.to_numpy(dtype=np.float64, na_value=np.nan)


def _from_xarray(xr: Any, data: Any, settings: LogSettings) -> Any:
    if not isinstance(data, xr.Dataset):
        return NotImplemented
    added = {}
    for channel in settings.channels(_DATA, [str(name) for name in data.variables]):
        angle = data[channel.angle.name]
        if angle.ndim != 1:
            raise ArgumentError(
                f"turns and travel are followed along one dimension, {channel.angle.name} has "
                f"{angle.ndim}"
            )
        used = {signal: data[name].to_numpy() for signal, name in channel.signals.items()}
        added[channel.angle.corrected] = (angle.dims, channel.correct(angle.to_numpy(), used))
    return data.assign(added)


def _from_dask_frame(dd: Any, data: Any, settings: LogSettings) -> Any:
    if not isinstance(data, dd.DataFrame):
        return NotImplemented
    if settings.needs_order:
        raise ArgumentError(_OUT_OF_ORDER.format("a Dask DataFrame", "correct its files instead"))
    import pandas as pd

    meta = _from_pandas(pd, data._meta_nonempty, settings)
    return data.map_partitions(_partition, settings, meta=meta)


def _partition(frame: Any, settings: LogSettings) -> Any:
    import pandas as pd

    return _from_pandas(pd, frame, settings)


def _from_dask_array(da: Any, data: Any, settings: LogSettings) -> Any:
    if not isinstance(data, da.Array):
        return NotImplemented
    kind = np.float32 if data.dtype == np.float32 else np.float64
    if not settings.needs_order:
        return data.map_blocks(_block, settings, dtype=kind)
    if not settings.counts_turns:
        raise ArgumentError(_OUT_OF_ORDER.format("a Dask array", "compute it first"))
    if data.ndim != 1:
        raise ArgumentError(
            "the model's error does not repeat after one turn, so turns are counted along the "
            f"array: give one of one dimension, got {data.ndim}"
        )
    return _in_order(da, data, settings, kind)


def _in_order(da: Any, data: Any, settings: LogSettings, kind: Any) -> Any:
    """Blocks corrected side by side once each knows in which turn it begins."""
    import dask

    from .turns import TurnState

    blocks = data.to_delayed().ravel()
    spans = [dask.delayed(_span)(block, settings) for block in blocks]
    after = dask.delayed(lambda span, state: span.after(state))
    states = [dask.delayed(TurnState)()]
    for span in spans[:-1]:
        states.append(after(span, states[-1]))
    made = [
        da.from_delayed(dask.delayed(_block)(block, settings, state), (rows,), dtype=kind)
        for block, state, rows in zip(blocks, states, data.chunks[0], strict=True)
    ]
    return da.concatenate(made)


def _span(block: Any, settings: LogSettings) -> Any:
    from .turns import TurnCounter, TurnSpan

    counter = TurnCounter(settings.joints[0].model.period)
    counter.count(block)
    known = block[np.isfinite(block)]
    return TurnSpan(counter.period, float(known[0]) if known.size else None, *counter.state)


def _block(block: Any, settings: LogSettings, state: Any = None) -> Any:
    return _array_channel(settings, state).correct(block)


def _array_channel(settings: LogSettings, state: Any = None) -> JointChannel:
    """Bare angles are what the sensor of the one joint reads, in the model's unit."""
    from ..support.angles import unit_name
    from .columns import AngleColumn

    if len(settings.joints) > 1:
        raise ArgumentError("an array holds one joint: give one model")
    (joint,) = settings.joints
    if joint.model.channels is not None:
        raise ArgumentError(
            "the model decodes a sine and a cosine channel: give a table with both columns, or "
            "take `model.channels.angle(sine, cosine)` and `model.correct`"
        )
    turn = joint.model.indicated_sign * joint.model.period
    angle = AngleColumn("", unit_name(joint.model.period), turn, "")
    return JointChannel(joint, angle, {}, JointState(state) if state else JointState(), settings)


_OUT_OF_ORDER = (
    "the model needs the rows in order, to count turns or to "
    "follow the direction of travel. {} does not keep the order: {}"
)

#: Library -> what corrects its data, or returns NotImplemented for other data.
_KINDS: Sequence[tuple[str, Callable[[Any, Any, LogSettings], Any]]] = (
    ("dask.dataframe", _from_dask_frame),
    ("dask.array", _from_dask_array),
    ("polars", _from_polars),
    ("pandas", _from_pandas),
    ("xarray", _from_xarray),
    ("pyarrow", _from_pyarrow),
)
