"""Functional mock-up units: the joint's sensor, or its correction, for simulators that load FMI."""

from __future__ import annotations

import io
import math
import platform
import shutil
import subprocess
import sys
import tempfile
import uuid
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np

from .._core import __version__
from ..errors import ArgumentError, FileError
from ..model.file import embedded_model
from ..model.model import HarmonicModel
from ..model.term import Term
from ..model.writing import model_text
from ..support.files import FileKind
from .codetext import code_file, code_parts, decoding, filled_code
from .cstep import DOUBLE, c_search, c_state, wave_tables
from .pattern import TurnPattern
from .proof import Proof
from .runtimeterms import RunTimeTerms, is_own_signal
from .target import CommentBlock, Made, Option, TablePart, Target

#: The model that a unit was made of, and its most bytes.
_MODEL = "resources/trueangle.json"


#: Folders of binaries and endings, by system and processor.
_SYSTEMS = {"linux": "linux", "darwin": "darwin", "win32": "windows"}
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
_ENDINGS = {"linux": ".so", "darwin": ".dylib", "windows": ".dll"}
_SECOND = {"linux": "linux64", "darwin": "darwin64", "windows": "win64"}

#: Of the library and of its functions.
_IDENTIFIER = "trueangle_model"


class Fmu(Target):
    """Target ``fmu``: FMI 3.0 or 2.0, co-simulation and model exchange, with its sources."""

    name = "fmu"
    what = "a functional mock-up unit (FMI), sensor or correction, for simulators"
    kind: ClassVar[FileKind] = FileKind("a functional mock-up unit", (".fmu",))
    sign = "subtract"
    arithmetic_known = False
    decodes = True
    options = {
        "variant": Option(
            ("correction", "sensor"),
            "correction",
            "correction: indicated (or sine and cosine) in, true_angle out; sensor: true_angle in, "
            "indicated out",
        ),
        "noise_std": Option(float, 0.0, "of a sensor: white noise, standard deviation in rad"),
        "fmi": Option(("3", "2"), "3", "version of the standard"),
    }

    def sign_of(self, options: Mapping[str, Any]) -> str:
        return "add" if options["variant"] == "sensor" else "subtract"

    def holds(self, term: Term) -> bool:
        return is_own_signal(term)

    def how(self, proof: Proof) -> str:
        return "the model's own series and terms in double precision"

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        model = pattern.source.replace(terms=tuple(filter(is_own_signal, pattern.source.terms)))
        sensor = options["variant"] == "sensor"
        noise_std = options["noise_std"]
        if noise_std and not sensor:
            raise ArgumentError('noise_std is of a sensor: give `variant="sensor"` as well')
        if not noise_std >= 0.0:
            raise ArgumentError(f"noise_std must be 0 or more radians, got {noise_std!r}")
        variables = variables_of(model, sensor, noise_std)
        notes = [
            "every step of a co-simulation is a reading: what follows travel takes the steps in "
            "their order; its output is of the inputs at its begin"
        ]
        binary = _folder(options["fmi"])
        if binary is None or shutil.which("cc") is None:
            notes.append(
                "holds no binary, as no C compiler (cc) is here: fmpy compile, or the tool that "
                "loads it, makes one of the sources"
            )
        return Made(
            text=lambda header: _source(model, variables, sensor, options["fmi"], header),
            entries=0,
            bytes=0,
            part=TablePart.at_readings(
                pattern,
                lambda places: pattern.taken_off(places / 2.0**32),
                zero=0.0,
                # Radians by which it differs from the model at most.
                resolution=1e-9 / (2.0 * math.pi),
                continuous=True,
            ),
            floor_arcsec=0.0,
            lost=list,
            notes=tuple(notes),
            decodes=not sensor and model.channels is not None,
            bits=12,
            packed=lambda text: _packed(model, variables, sensor, options["fmi"], text),
        )

    def decoded(self, raw: bytes) -> str:
        try:
            with zipfile.ZipFile(io.BytesIO(raw)) as archive:
                size = archive.getinfo(_MODEL).file_size
                return archive.read(_MODEL).decode() if size <= 16 << 20 else ""
        except (zipfile.BadZipFile, KeyError, NotImplementedError, EOFError, zlib.error):
            return ""

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        if not text:
            raise FileError(path, f"holds no {_MODEL}: no functional mock-up unit of trueangle")
        return embedded_model(text, path)


def _token(text: str) -> str:
    """The same for the same source."""
    return f"{{{uuid.uuid5(uuid.NAMESPACE_OID, text)}}}"


def _source(
    model: HarmonicModel,
    variables: Sequence[FmuVariable],
    sensor: bool,
    fmi: str,
    header: CommentBlock,
) -> str:
    own = [
        f"{'Sensor' if sensor else 'Correction'} of a joint as a functional mock-up unit of FMI "
        f"{fmi}.0; angles in radians.",
    ]
    head = "/*\n" + "\n".join(header.comment(" * ", *own)) + "\n */\n"
    bare = fmu_source(model, variables, sensor, head)
    return bare + _fmi_functions(fmi, _token(bare + fmi))


def _packed(
    model: HarmonicModel, variables: Sequence[FmuVariable], sensor: bool, fmi: str, source: str
) -> bytes:
    """The archive: description, source and, where there is a compiler, the library."""
    token = source[source.index('strcmp(token, "') + 15 :].partition('"')[0]
    about = " ".join(line[3:] for line in source.split("\n")[1:6])
    files: dict[str, bytes] = {
        "modelDescription.xml": model_description(
            variables, fmi, sensor, token, about, f"trueangle {__version__}"
        ).encode(),
        "sources/model.c": source.encode(),
        _MODEL: model_text(model).encode(),
    }
    if fmi == "3":
        files["sources/buildDescription.xml"] = _build_description().encode()
    library = _library(source)
    folder = _folder(fmi)
    if library is not None and folder is not None:
        files[f"binaries/{folder}/{_IDENTIFIER}{_ending()}"] = library
    out = io.BytesIO()
    with zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():  # the same bytes for the same model
            archive.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content)
    return out.getvalue()


def _ending() -> str:
    return _ENDINGS[_SYSTEMS[sys.platform]]


def _folder(fmi: str) -> str | None:
    """Where the binary of this platform belongs; None where FMI has no name for it."""
    system = _SYSTEMS.get(sys.platform)
    processor = _PROCESSORS.get(platform.machine().lower())
    if system is None or processor is None:
        return None
    if fmi == "3":
        return f"{processor}-{system}"
    return _SECOND[system] if processor == "x86_64" else None


def _library(source: str) -> bytes | None:
    """The source compiled here, where there is a compiler that does."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform not in _SYSTEMS:
        return None
    with tempfile.TemporaryDirectory() as folder:
        file, library = Path(folder, "model.c"), Path(folder, f"model{_ending()}")
        file.write_text(source, encoding="utf-8")
        fast = ["-O3", "-fno-math-errno", "-ffp-contract=off"]
        command = [compiler, "-std=c99", *fast, "-fPIC", "-shared", "-fvisibility=hidden"]
        done = subprocess.run(
            [*command, str(file), "-o", str(library), "-lm"],
            capture_output=True,
            timeout=120,
            check=False,
        )
        return library.read_bytes() if done.returncode == 0 else None


class FmuVariable(NamedTuple):
    """One variable; its place in the list is its value reference."""

    name: str
    reference: int
    causality: str
    variability: str
    unit: str
    start: float
    description: str


def variables_of(model: HarmonicModel, sensor: bool, noise_std: float = 0.0) -> list[FmuVariable]:
    """The time, inputs, parameters and the output last."""
    true = "true angle of the joint"
    said = "angle that its encoder indicates"
    first, last = (("true_angle", true), ("indicated", said))[:: 1 if sensor else -1]
    rows = [("time", "independent", "continuous", "s", 0.0, "time")]
    if sensor or model.channels is None:
        rows.append((first[0], "input", "continuous", "rad", 0.0, first[1]))
    else:
        tracks = filter(None, (model.channels, model.channels.second))
        starts = np.concatenate([track.curve(np.zeros(1)) for track in tracks]).ravel().tolist()
        rows += [
            (name, "input", "continuous", "", start, f"{name} channel of its encoder")
            for name, start in zip(model.channels.roles, starts, strict=False)
        ]
    rows += [
        ("velocity", "input", "continuous", "rad/s", 0.0, "velocity of the joint"),
        ("torque", "input", "continuous", "N.m", 0.0, "torque at the output"),
        ("temperature", "input", "continuous", "K", 293.15, "temperature of the joint"),
    ]
    if "current" in model.signals:
        rows.append(("current", "input", "continuous", "A", 0.0, "current of the motor"))
    if sensor:
        rows += [
            (
                "noise_std",
                "parameter",
                "tunable",
                "rad",
                noise_std,
                "standard deviation of white noise",
            ),
            ("seed", "parameter", "fixed", "", 1.0, "of the noise"),
        ]
    rows.append((last[0], "output", "continuous", "rad", 0.0, last[1]))
    return [FmuVariable(name, i, *rest) for i, (name, *rest) in enumerate(rows)]  # type: ignore[arg-type]


def fmu_source(
    model: HarmonicModel, variables: Sequence[FmuVariable], sensor: bool, head: str
) -> str:
    """What the unit's library is compiled from, but for the functions of FMI."""
    terms = RunTimeTerms.of(model, model.terms, "auto")
    at_indicated = model.argument == "indicated"
    zero = DOUBLE.number(model.constant / model.period)
    core = [
        c_state(terms, DOUBLE),
        c_search(terms, DOUBLE, model.constant / model.period, at_indicated, _pattern(terms, zero)),
    ]
    if sensor:
        core.append(_sense(terms, zero, at_indicated))
    else:
        start = f"reading - {zero} - m_series(reading, 0)" if at_indicated else "reading"
        late = f" + signals->velocity * {DOUBLE.number(terms.delay)}" if terms.delay else ""
        core.append(_part("correct", start=start, late=late))
    by_name = {variable.name: variable.reference for variable in variables}
    reading = "me->value[1] / turn"
    if "sine" in by_name and model.channels is not None:
        core.append(decoding(model.channels, code_parts("fmu.c"), 1.0, "m_{}".format))
        values = (f"me->value[{by_name[role]}]" for role in model.channels.roles)
        reading = f"m_decode({', '.join(values)})"
    scale = {"velocity": " / turn", "temperature": " - 273.15"}
    signals = [
        f"known += signals.{name} = me->value[{by_name[name]}]{scale.get(name, '')};"
        for name in terms.signals
    ]
    instance = _part(
        "instance",
        count=len(variables),
        output=next(v.reference for v in variables if v.causality == "output"),
        noise=by_name.get("noise_std", 0),
        seed=by_name.get("seed", 0),
        start=", ".join(DOUBLE.number(v.start) for v in variables),
        signals="\n".join(signals),
        reading=reading,
    )
    text = "\n".join([*core, instance, ""])
    return f"{head}\n{_part('includes')}\n" + filled_code(text, n="m")


def _fmi_functions(fmi: str, token: str) -> str:
    """All functions that version 2 or 3 of the standard wants of a library."""
    return f"{_part('created')}\n{filled_code(code_file(f'fmi{fmi}.c'), token=token)}"


def _part(name: str, **values: object) -> str:
    return filled_code(code_parts("fmu.c")[name], **values)


def _pattern(terms: RunTimeTerms, zero: str) -> str:
    """The series and its inverse."""
    series = terms.series
    table, loop = "", "(void)i;"
    if series.orders:
        table = wave_tables("m_series0", series, DOUBLE, False)
        loop = _part("sum", count=len(series.orders))
    pairs = zip(series.orders, series.amplitudes, strict=True)
    bend = sum((2.0 * math.pi * m) ** 2 * c for m, c in pairs)
    # Turns that the last step of a search may leave.
    near = math.sqrt(1e-17 * max(1.0 - series.slope, 0.0) / max(bend, 1.0))
    size = DOUBLE.number(sum(series.amplitudes) * (1.0 + 1e-9) + 1e-12)
    series_text = _part("series", sum=loop, zero=zero, near=DOUBLE.number(near), size=size)
    return f"{table}\n{series_text}"


def _sense(terms: RunTimeTerms, zero: str, at_indicated: bool) -> str:
    """What an encoder reads: the pattern and the terms, and the travel that they follow."""
    held = "state->stretch.direction" if terms.springs else "state->direction"
    travel, direction = "(void)state;", "0"
    if terms.travels:
        by_angle = "state->known ? seen - state->farthest : 0.0"
        travel = _part(
            "sensed travel",
            moved="state->stretch.place += turns;" if terms.springs else "",
            way=by_angle if terms.way == "angle" else "signals->velocity",
            held=held,
        )
        direction = held
    if terms.springs:
        direction += ", 0, m_wound(&state->stretch, state->farthest)"
    early = f" - signals->velocity * {DOUBLE.number(terms.delay)}" if terms.delay else ""
    reading = f"y + {zero} + m_series(seen, 0)"
    if at_indicated:
        reading = f"m_solved(y, -1.0, y + {zero})"
    return _part("sense", early=early, travel=travel, direction=direction, reading=reading)


def model_description(
    variables: Sequence[FmuVariable], fmi: str, sensor: bool, token: str, about: str, tool: str
) -> str:
    """modelDescription.xml of FMI 3.0 or 2.0."""
    # Of version 2 the time is no variable, and unknowns are counted from 1.
    listed = variables if fmi == "3" else variables[1:]
    return filled_code(
        code_file(f"fmi{fmi}.xml"),
        identifier=_IDENTIFIER,
        name=quoteattr(f"trueangle {'sensor' if sensor else 'correction'}"),
        token=token,
        variables="\n".join(_element(v, fmi) for v in listed),
        output=variables[-1].reference,
        tool=quoteattr(tool),
        about=quoteattr(about),
    )


def _build_description() -> str:
    """sources/buildDescription.xml of FMI 3.0."""
    return filled_code(code_file("fmibuild.xml"), identifier=_IDENTIFIER)


def _element(v: FmuVariable, fmi: str) -> str:
    """One variable of modelDescription.xml."""
    start = "" if v.causality in ("independent", "output") else f' start="{v.start!r}"'
    unit = f' unit="{v.unit}"' if v.unit else ""
    told = (
        f'name="{v.name}" valueReference="{v.reference}" causality="{v.causality}" '
        f'variability="{v.variability}" description="{v.description}"'
    )
    if fmi == "3":
        return f"<Float64 {told}{unit}{start}/>"
    return f"<ScalarVariable {told}><Real{unit}{start}/></ScalarVariable>"
