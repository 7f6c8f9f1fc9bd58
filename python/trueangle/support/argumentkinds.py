"""Arguments of a wrong kind or type, named after a call has failed of one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import wraps
from itertools import islice
from typing import Any, TypeVar

from ..errors import KindError, TrueAngleError

F = TypeVar("F", bound=Callable[..., Any])


#: What code raises that meets an object it cannot use.
_FAILURES = (TypeError, AttributeError, ValueError, LookupError, ArithmeticError)

T = TypeVar("T")

#: Characters of a value that a message repeats.
_SHOWN = 60


def told_kinds(function: F) -> F:
    """A function or class whose failures name an argument that is not what it is declared to be.

    Nothing is looked at before the call and where it succeeds. One that fails for another
    reason, with every argument of its kind, fails as it did.

    Raises
    ------
    KindError
        Names the argument, its declared kind and what was got.

    Examples
    --------
    >>> @told_kinds
    ... def half(angle: float) -> float:
    ...     return angle / 2
    >>> half("x")
    Traceback (most recent call last):
    ...
    trueangle.errors.KindError: angle must be float, got 'x' (str)
    """
    if isinstance(function, type):
        made: Any = function
        made.__init__ = told_kinds(made.__init__)
        return function

    @wraps(function)
    def told(*args: Any, **kwargs: Any) -> Any:
        try:
            return function(*args, **kwargs)
        except _FAILURES as error:
            if isinstance(error, KindError) or not isinstance(error, TrueAngleError):
                _refuse(function, args, kwargs, error)
            raise

    return told  # type: ignore[return-value]


def _refuse(
    function: Callable[..., Any], args: Any, kwargs: Mapping[str, Any], error: Exception
) -> None:
    """Raise where an argument is at fault, unless the error already states it."""
    import inspect

    signature = inspect.signature(function)
    try:
        given = signature.bind(*args, **kwargs).arguments
    except TypeError:
        return
    names = _Names(function)
    for name, value in given.items():
        parameter = signature.parameters[name]
        wanted = parameter.annotation
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD):
            continue
        try:
            kind = eval(wanted, {}, names) if isinstance(wanted, str) else wanted
        except (NameError, TypeError, AttributeError):
            continue
        if kind is not parameter.empty and not _fits(value, kind):
            if isinstance(error, KindError) and str(error).startswith(name):
                return
            raise KindError(
                f"{name} must be {wanted}, got {value!r:.60} ({type(value).__name__})"
            ) from error


class _Names(dict[str, Any]):
    """What the names in a declaration mean; unknown names mean any type."""

    def __init__(self, function: Any) -> None:
        import builtins
        from os import PathLike

        import numpy as np

        arrays = dict.fromkeys(("Array", "ArrayLike", "NDArray"), np.ndarray)
        known = {"PathLike": PathLike, **function.__globals__}
        super().__init__({**vars(builtins), **known, **arrays})

    def __missing__(self, name: str) -> Any:
        """A class that the module of the declaration knows for type checkers alone."""
        import sys

        package = __name__.partition(".")[0]
        modules = [m for key, m in list(sys.modules.items()) if key.partition(".")[0] == package]
        found = {kind for m in modules if isinstance(kind := vars(m).get(name), type)}
        return found.pop() if len(found) == 1 else Any


def _fits(value: Any, kind: Any) -> bool:
    """Whether a value is of a kind, as far as its type and its first items show."""
    import typing
    from os import PathLike
    from types import UnionType

    import numpy as np

    origin, inner = typing.get_origin(kind) or kind, typing.get_args(kind)
    if origin is Any or isinstance(origin, typing.TypeVar):
        return True
    if origin in (typing.Union, UnionType):
        return any(_fits(value, one) for one in inner)
    if origin is typing.Literal:
        return isinstance(value, str | None) and value in inner
    if kind is None or origin is type(None):
        return value is None
    if origin is np.ndarray:
        return _is_numbers(value)
    if origin in (int, float):
        kinds = "iu" if origin is int else "iuf"
        return np.ndim(value) == 0 and not isinstance(value, str) and _is_numbers(value, kinds)
    if origin is PathLike:
        return isinstance(value, str | PathLike)
    if not isinstance(origin, type):
        return True
    if issubclass(origin, Mapping):
        if not isinstance(value, Mapping):
            return False
        parts = (value.keys(), value.values())[: len(inner)]
        return all(_fits(one, of) for of, part in zip(inner, parts, strict=True) for one in part)
    if issubclass(origin, str) or not issubclass(origin, Iterable) or hasattr(origin, "summary"):
        return isinstance(value, origin)
    if isinstance(value, str | bytes | Mapping):
        return False
    try:
        iter(value)
    except TypeError:
        return False
    if isinstance(value, Iterator) or not inner:
        return True
    # How many items of a collection are looked at: one may be longer than there is time for.
    return all(_fits(item, inner[0]) for item in islice(value, 1000))


def _is_numbers(value: Any, kinds: str = "iuf") -> bool:
    import numpy as np

    if isinstance(value, range):
        return "i" in kinds  # as an array it may be larger than the memory
    try:
        return np.asarray(value).dtype.kind in kinds
    except (TypeError, ValueError):
        return False


def of_type(
    what: str, value: object, kind: type[T], wanted: str, instead: Callable[[Any], str] = str
) -> T:
    """``value``, which must be a ``kind``.

    Messages call the argument ``what``, and state what is ``wanted`` and what to use in place of
    the given value (``instead``).

    Raises
    ------
    KindError
        It is something else: names what was got and what is wanted.
    """
    if isinstance(value, kind):
        return value
    meant = "" if instead is str else instead(value)
    told = f"{what} must be {wanted}, got {_told(value)}"
    raise KindError(f"{told}; {meant}" if meant else told)


def all_of_type(
    what: str,
    values: Iterable[Any],
    kind: type[T],
    wanted: str,
    instead: Callable[[Any], str] = str,
) -> tuple[T, ...]:
    """``values`` as a tuple, each of which must be a ``kind``; see `of_type`.

    Examples
    --------
    >>> all_of_type("sizes", [1, 2], int, "a whole number")
    (1, 2)
    """
    if not isinstance(values, Iterable) or isinstance(values, str | kind):
        raise KindError(f"{what} must be a list, each {wanted}, got {_told(values)}")
    found = tuple(values)
    for i, value in enumerate(found):
        of_type(f"{what}[{i}]", value, kind, wanted, instead)
    return found


def _told(value: object) -> str:
    """What a value is, in few words."""
    shown = " ".join(repr(value).split())
    if len(shown) > _SHOWN:
        shown = shown[: _SHOWN - 3] + "..."
    noun = getattr(type(value), "noun", "")
    if noun:
        return f"{noun}, {shown}"
    name = type(value).__name__
    return shown if shown.startswith(name) else f"{name} {shown}"
