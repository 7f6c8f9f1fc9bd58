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
from typing import Any, ClassVar

from .._core import __version__
from ..errors import ArgumentError
from ..model.file import embedded_model
from ..model.model import HarmonicModel
from ..model.term import Term
from ..model.writing import model_text
from ..support.files import FileKind
from .fmufiles import (
    IDENTIFIER,
    FmuVariable,
    build_description,
    fmi_functions,
    fmu_source,
    model_description,
    variables_of,
)
from .pattern import TurnPattern
from .proof import Proof
from .reading import table_error
from .runtimeterms import is_own_signal
from .target import CommentBlock, Made, Option, TablePart, Target

#: The model that a unit was made of, and its most bytes.
_MODEL = "resources/trueangle.json"
_MOST_BYTES = 16 << 20

#: Radians by which it differs from the model at most.
_WITHIN = 1e-9

#: Folders of binaries and endings, by system and processor.
_SYSTEMS = {"linux": "linux", "darwin": "darwin", "win32": "windows"}
_PROCESSORS = {"x86_64": "x86_64", "amd64": "x86_64", "aarch64": "aarch64", "arm64": "aarch64"}
_ENDINGS = {"linux": ".so", "darwin": ".dylib", "windows": ".dll"}
_SECOND = {"linux": "linux64", "darwin": "darwin64", "windows": "win64"}


class Fmu(Target):
    """Target ``fmu``: FMI 3.0 or 2.0, co-simulation and model exchange, with its sources."""

    name = "fmu"
    what = "a functional mock-up unit (FMI), sensor or correction, for simulators"
    kind: ClassVar[FileKind] = FileKind("a functional mock-up unit", (".fmu",))
    sign = "subtract"
    arithmetic_known = False
    options = {
        "variant": Option(
            ("correction", "sensor"),
            "correction",
            "correction: indicated in, true_angle out; sensor: true_angle in, indicated out",
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
                resolution=_WITHIN / (2.0 * math.pi),
                continuous=True,
            ),
            floor_arcsec=0.0,
            lost=list,
            notes=tuple(notes),
            bits=12,
            packed=lambda text: _packed(model, variables, sensor, options["fmi"], text),
        )

    def decoded(self, raw: bytes) -> str:
        try:
            with zipfile.ZipFile(io.BytesIO(raw)) as archive:
                size = archive.getinfo(_MODEL).file_size
                return archive.read(_MODEL).decode() if size <= _MOST_BYTES else ""
        except (zipfile.BadZipFile, KeyError, NotImplementedError, EOFError, zlib.error):
            return ""

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        if not text:
            raise table_error(path, f"holds no {_MODEL}: no functional mock-up unit of trueangle")
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
    return bare + fmi_functions(fmi, _token(bare + fmi))


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
        files["sources/buildDescription.xml"] = build_description().encode()
    library = _library(source)
    folder = _folder(fmi)
    if library is not None and folder is not None:
        files[f"binaries/{folder}/{IDENTIFIER}{_ending()}"] = library
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
