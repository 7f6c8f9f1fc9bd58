"""The text of a simulation file: TOML decoded with checks, and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from ..effects import KINDS, Effect
from ..errors import ArgumentError, FileError
from ..joint.joint import Bearing, DeclaredShaft, Head, Joint
from ..joint.pattern import Harmonic
from ..support.decoding import finite_float, read_text, shown_value, toml_value
from ..support.files import SIMULATION, SIMULATION_BYTES, written_atomically
from ..support.suggestions import did_you_mean
from .designs import MAX_SAMPLES, RunDesign

_TABLES = ("joint", "shaft", "bearing", "head", "harmonic", "effect", "noise", "run")
_JOINT_KEYS = ("gear_ratio", "fixed_member", "encoder_side", "pole_pairs")

#: Tables of what a joint declares: field of `Joint`, name of the table, what each makes.
_DECLARED: tuple[tuple[str, str, Any], ...] = (
    ("declared", "shaft", DeclaredShaft),
    ("bearings", "bearing", Bearing),
    ("heads", "head", Head),
)

#: Lines, effects, runs, or numbers of one list, at most.
MAX_TABLES = 10_000

T = TypeVar("T")


class StatedSimulation(NamedTuple):
    """What a simulation file states, the fields of `Simulation` in their order."""

    joint: Joint
    harmonics: tuple[Harmonic, ...]
    effects: tuple[Effect, ...]
    sigma_arcsec: float
    runs: tuple[RunDesign, ...]
    source: str | None


def decoded_simulation(path: str | Path) -> StatedSimulation:
    """The checked parts of a simulation file; see `load_simulation`."""
    text = read_text(path, SIMULATION_BYTES, FileError, "a simulation")
    return _decoded(path, toml_value(path, text, "a simulation"))


def _decoded(path: str | Path, document: Mapping[str, Any]) -> StatedSimulation:
    for name in document:
        if name not in _TABLES:
            raise FileError(
                path,
                f"unknown table {shown_value(name)}; a simulation has "
                f"{', '.join(_TABLES)}{did_you_mean(name, _TABLES)}",
            )
    joint = _joint(path, document)
    harmonics = tuple(
        _build(path, f"[[harmonic]] number {k}", Harmonic, table)
        for k, table in enumerate(_tables(path, document, "harmonic"), 1)
    )
    effects = tuple(
        _effect(path, f"[[effect]] number {k}", table)
        for k, table in enumerate(_tables(path, document, "effect"), 1)
    )
    designs = tuple(
        _build(path, f"[[run]] number {k}", RunDesign, table)
        for k, table in enumerate(_tables(path, document, "run"), 1)
    )
    samples = sum(design.samples for design in designs)
    if samples > MAX_SAMPLES:
        raise FileError(path, f"{samples} samples in its runs; allowed are {MAX_SAMPLES} in all")
    noise = _table(path, document, "noise")
    for name in noise:
        if name != "sigma_arcsec":
            raise FileError(path, f"[noise]: unknown key {shown_value(name)}; it has sigma_arcsec")
    sigma = finite_float(noise.get("sigma_arcsec", 0.0))
    if sigma is None:
        got = shown_value(noise["sigma_arcsec"])
        raise FileError(path, f"[noise]: sigma_arcsec must be a finite number, got {got}")
    return StatedSimulation(joint, harmonics, effects, sigma, designs, str(path))


def _joint(path: str | Path, document: Mapping[str, Any]) -> Joint:
    """The gear, with the further shafts, bearings and heads that the file declares."""
    table = _table(path, document, "joint")
    for name in table:
        if name not in _JOINT_KEYS:
            raise FileError(
                path,
                f"[joint]: unknown key {shown_value(name)}; it has "
                f"{', '.join(_JOINT_KEYS)}{did_you_mean(name, _JOINT_KEYS)}",
            )
    gear = _build(path, "[joint]", Joint, _geared(table))
    further: dict[str, Any] = {
        field: tuple(
            _build(path, f"[[{name}]] number {k}", kind, entry)
            for k, entry in enumerate(_tables(path, document, name), 1)
        )
        for field, name, kind in _DECLARED
    }
    if not any(further.values()):
        return gear
    where = ", ".join(f"[[{name}]]" for field, name, _ in _DECLARED if further[field])
    return guarded_build(path, where, lambda: replace(gear, **further))


def _geared(joint: Mapping[str, Any]) -> Mapping[str, Any]:
    """A gear is a strain wave gear behind a motor encoder unless the file states otherwise."""
    if joint.get("gear_ratio", 1.0) == 1.0:
        return joint
    return {"fixed_member": "circular_spline", "encoder_side": "motor"} | dict(joint)


def _table(path: str | Path, document: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    table = document.get(name, {})
    if not isinstance(table, dict):
        raise FileError(path, f"'{name}' must be one table, [{name}]")
    return table


def _tables(path: str | Path, document: Mapping[str, Any], name: str) -> list[dict[str, Any]]:
    tables = document.get(name, [])
    if not isinstance(tables, list) or not all(isinstance(table, dict) for table in tables):
        raise FileError(path, f"'{name}' must be a list of tables, [[{name}]]")
    if len(tables) > MAX_TABLES:
        raise FileError(path, f"{len(tables)} tables [[{name}]]; at most {MAX_TABLES} are allowed")
    return tables


def _build(path: str | Path, where: str, kind: type[T], table: Mapping[str, Any]) -> T:
    known = {field.name: str(field.type) for field in fields(kind)}  # type: ignore[arg-type]
    values = {}
    for name, value in table.items():
        if name not in known:
            raise FileError(
                path,
                f"{where}: unknown key {shown_value(name)}; it has "
                f"{', '.join(known)}{did_you_mean(name, known)}",
            )
        values[name] = _value(path, where, name, value, known[name])
    try:
        return guarded_build(path, where, lambda: kind(**values))
    except TypeError as cause:
        missing = str(cause).rpartition(": ")[2]
        raise FileError(path, f"{where}: missing {missing}") from None


def _value(path: str | Path, where: str, name: str, value: Any, wanted: str) -> Any:
    def refuse(what: str) -> FileError:
        return FileError(path, f"{where}: {name} must be {what}, got {shown_value(value)}")

    if wanted.startswith("str"):
        if not isinstance(value, str):
            raise refuse("a text")
        return value
    if wanted.startswith("tuple[tuple"):
        if not isinstance(value, dict):
            raise refuse("a table of lists of numbers")
        return tuple(
            (key, _value(path, where, f"{name}.{key}", entry, "tuple"))
            for key, entry in value.items()
        )
    if wanted.startswith("tuple"):
        numbers = tuple(map(finite_float, value)) if isinstance(value, list) else (None,)
        if None in numbers:
            raise refuse("a list of finite numbers")
        if len(numbers) > MAX_TABLES:
            raise refuse(f"a list of at most {MAX_TABLES} numbers")
        return numbers
    number = finite_float(value)
    if number is None:
        raise refuse("a finite number")
    if wanted.startswith("int"):
        if number != int(number):
            raise refuse("a whole number")
        return int(number)
    return number


def _effect(path: str | Path, where: str, table: dict[str, Any]) -> Effect:
    parameters = dict(table)
    kind = parameters.pop("kind", None)
    if not isinstance(kind, str) or kind not in KINDS:
        raise FileError(
            path,
            f"{where}: kind must be one of {', '.join(KINDS)}, got "
            f"{'none' if kind is None else shown_value(kind)}"
            f"{did_you_mean(kind, KINDS) if isinstance(kind, str) else ''}",
        )
    for name, value in parameters.items():
        parameters[name] = _checked_numbers(path, f"{where}: {shown_value(name)}", value)
    return guarded_build(path, where, lambda: KINDS[kind].from_table(parameters))


def _checked_numbers(path: str | Path, where: str, value: Any) -> Any:
    """A parameter whose numbers, in lists of lists too, are finite and not too many."""
    if isinstance(value, list):
        if len(value) > MAX_TABLES:
            raise FileError(path, f"{where} must be a list of at most {MAX_TABLES}")
        return [_checked_numbers(path, where, item) for item in value]
    if isinstance(value, int | float) and not isinstance(value, bool):
        if finite_float(value) is None:
            raise FileError(path, f"{where} must be a finite number, got {shown_value(value)}")
        return value if abs(value) < 2**53 else float(value)
    return value


def guarded_build(path: str | Path, where: str, build: Callable[[], T]) -> T:
    """What ``build`` makes; its refusals name the file and the place in it."""
    try:
        return build()
    except FileError:
        raise
    except ArgumentError as cause:
        raise FileError(path, f"{where}: {cause}") from None


def simulation_table(sim: StatedSimulation) -> dict[str, Any]:
    """The tables of a simulation file; ``run`` omits keys at their defaults."""
    runs = []
    for design in sim.runs:
        values = {field.name: getattr(design, field.name) for field in fields(design)}
        plain = {field.name: field.default for field in fields(design)}
        given = {k: v for k, v in values.items() if v is not None and v != plain[k]}
        if "coupled" in given:
            given["coupled"] = dict(given["coupled"])
        runs.append(given)
    return {
        "joint": {name: getattr(sim.joint, name) for name in _JOINT_KEYS},
        **{
            name: [_given(entry) for entry in getattr(sim.joint, field)]
            for field, name, _ in _DECLARED
        },
        "harmonic": [_given(line) for line in sim.harmonics],
        "effect": [effect.to_table() for effect in sim.effects],
        "noise": {"sigma_arcsec": sim.sigma_arcsec},
        "run": runs,
    }


def _given(entry: Any) -> dict[str, Any]:
    """Fields of one table that have a value."""
    values = {field.name: getattr(entry, field.name) for field in fields(entry)}
    return {name: value for name, value in values.items() if value is not None}


def write_simulation(sim: StatedSimulation, path: str | Path) -> None:
    """Write a simulation file under a temporary name, then rename it; floats round-trip exactly.

    Where the simulation was read from a file, that file's text is kept and only what
    is new is appended, so comments and layout stay. Otherwise the whole is written.
    """
    text = simulation_text(sim)
    with written_atomically(path, kind=SIMULATION) as file:
        file.write(text)


def simulation_text(sim: StatedSimulation) -> str:
    """The text of a simulation file, as `write_simulation` writes it."""
    whole = simulation_table(sim)
    if sim.source is not None and Path(sim.source).is_file():
        import tomllib

        text = Path(sim.source).read_text(encoding="utf-8").rstrip("\n")
        old = simulation_table(decoded_simulation(sim.source))
        appended: dict[str, Any] = {
            name: whole[name][len(old[name]) :] for name in ("harmonic", "effect", "run")
        }
        kept: dict[str, Any] = {name: [*old[name], *appended[name]] for name in appended}
        if "noise" not in tomllib.loads(text) and whole["noise"] != old["noise"]:
            appended["noise"] = kept["noise"] = whole["noise"]
        if {**old, **kept} == whole:
            return text + "\n" + "".join(_dump(name, appended[name]) for name in appended)
    return "".join(_dump(name, whole[name]) for name in _TABLES).lstrip("\n")


def _dump(name: str, content: Any) -> str:
    if isinstance(content, list):
        return "".join(f"\n[[{name}]]\n{_lines(table)}" for table in content)
    return f"\n[{name}]\n{_lines(content)}"


def _lines(table: Mapping[str, Any]) -> str:
    return "".join(f"{name} = {_literal(value)}\n" for name, value in table.items())


def _literal(value: Any) -> str:
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c >= " " else f"\\u{ord(c):04x}" for c in escaped) + '"'
    if isinstance(value, Mapping):
        rows = (f"{_literal(name)} = {_literal(entry)}" for name, entry in value.items())
        return "{ " + ", ".join(rows) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_literal(item) for item in value) + "]"
    if isinstance(value, int):
        return str(value)
    return repr(float(value))
