"""The public interface as the code has it, for ``reference/interface.md``.

``python docs/interface.py`` writes it into the page anew; a test compares them, so that whoever
changes what users rely on sees it in the difference of the page.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import json
import re
import tempfile
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path

import trueangle as ta
from trueangle import cli
from trueangle.certificate import document
from trueangle.effects import EFFECTS
from trueangle.export import TARGETS
from trueangle.fleets import file as fleetfile
from trueangle.fleets import result as fleets
from trueangle.formats.formats import FORMATS
from trueangle.model import file as modelfile
from trueangle.model import robot as robotfile
from trueangle.model import writing
from trueangle.model.term import TERMS, Term
from trueangle.reports import composition
from trueangle.runs.source import ReadingOptions
from trueangle.simulation import RunDesign
from trueangle.support.roles import ANGLES, LABELS
from trueangle.support.signals import SIGNALS

__all__ = ["PAGE", "interface_text", "written"]

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reference" / "interface.md"
#: Between these lines of the page stands what the code has.
BEGIN = "<!-- from the code: python docs/interface.py -->\n"
END = "<!-- end of what the code has -->\n"

#: What `to_dict` and the commands print with ``--json``, and a call that prints it.
PRINTING = {
    "check": "check runs.csv",
    "compare": "compare joint.json joint.json",
    "correct": "correct runs.csv -m joint.json -o corrected.csv",
    "diagnose": "diagnose runs.csv --simulation joint.toml",
    "export": "export joint.json --to c -o joint.h",
    "fit": "fit runs.csv -o joint.json --orders 1,4",
    "fleet": "fleet runs.csv --by run --orders 1,4",
    "orders": "orders runs.csv --orders 1-4",
    "plan": "plan --gear-ratio 100",
    "simulate": "simulate joint.toml -o runs.csv",
}
JOINT = """\
[[harmonic]]
shaft = "output"
order = 1
amplitude_arcsec = 60.0
[[harmonic]]
shaft = "output"
order = 4
amplitude_arcsec = 20.0
[noise]
sigma_arcsec = 2.0
""" + "".join(f'[[run]]\nlabel = "{k}"\nsamples = 72\nstart_deg = {k}\n' for k in range(4))


def interface_text() -> str:
    """Everything below the promise: the sections that come from the code."""
    parts = (names, commands, printed, files, simulations, steps)
    return "\n".join(line for part in parts for line in part())


def names() -> Iterator[str]:
    """Python names with their arguments and members."""
    yield from ("## Python", "")
    yield from ("| `trueangle.` | arguments, or members of a result |", "| --- | --- |")
    for name in ta.__all__:
        what = getattr(ta, name)
        if inspect.isclass(what) and issubclass(what, Term):
            yield f"| `{name}` | {listed(field.name for field in fields(what))} |"
        elif inspect.isclass(what):
            yield f"| `{name}` | {members(what)} |"
        elif callable(what):
            yield f"| `{name}()` | {arguments(what)} |"
        else:
            held = [n for n in getattr(what, "__all__", ()) if n != "level_of_caller"]
            yield f"| `{name}` | {listed(held) or 'text'} |"
    yield from ("", f"*reading*: {listed(ReadingOptions.__annotations__)}.", "")


def arguments(function: object) -> str:
    """Names of the arguments, those after ``*`` by keyword only."""
    said, starred = [], False
    for name, parameter in inspect.signature(function).parameters.items():  # type: ignore[arg-type]
        if parameter.kind is parameter.KEYWORD_ONLY and not starred:
            said, starred = [*said, "\\*"], True
        options = parameter.kind is parameter.VAR_KEYWORD
        said.append("*options*" if name == "options" else "*reading*" if options else f"`{name}`")
    return ", ".join(said)


def members(kind: type) -> str:
    """Attributes and methods that users call, of the class and of those of the package below it."""
    ours = [c for c in kind.__mro__ if c.__module__.startswith("trueangle")]
    found = {name for c in ours for name in vars(c)}
    found |= {field.name for c in ours if is_dataclass(c) for field in fields(c)}
    return listed(sorted(name for name in found if not name.startswith("_")))


def commands() -> Iterator[str]:
    """Commands with their arguments and options."""
    parsers = cli.build_parser().commands
    common = {"--help", "--debug"}
    yield from ("## Commands", "", "| `trueangle` | arguments and options |", "| --- | --- |")
    for name in cli.COMMANDS:
        said = []
        for action in parsers[name]._actions:
            spelled = action.option_strings or [action.metavar or action.dest]
            if not common & set(spelled):
                said.append("/".join(spelled).replace("|", "\\|"))
        yield f"| `{name}` | {listed(said)} |"
    yield from ("", f"All have {listed(sorted(common))}.", "")


def printed() -> Iterator[str]:
    """Keys at the top of what commands print with ``--json``."""
    yield from ("## JSON of commands", "", "| `--json` | keys at the top |", "| --- | --- |")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("joint.toml").write_text(JOINT, encoding="utf-8")
        found = {}
        for name in ("simulate", "fit", *PRINTING):
            out = io.StringIO()
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
                status = cli.main([*PRINTING[name].split(), "--json"])
            assert status == 0, name
            found[name] = listed(json.loads(out.getvalue()))
    yield from (f"| `{name}` | {found[name]} |" for name in sorted(found))
    yield ""


def files() -> Iterator[str]:
    """Files that are read and written, with their versions."""
    yield from ("## Files", "", "| `format` | `version` | keys |", "| --- | --- | --- |")
    for form, version, keys in (
        (writing.FORMAT, writing.VERSION, modelfile._KEYS),
        (writing.ROBOT_FORMAT, writing.VERSION, robotfile._KEYS),
        (fleets.FORMAT, fleets.VERSION, ["format", "version", *fleetfile._KEYS]),
        (document.FORMAT, document.VERSION, []),
        (composition.FORMAT, composition.VERSION, []),
    ):
        yield f"| `{form}` | {version} | {listed(keys) or 'of a page'} |"
    yield from ("", f"Terms of a model: {listed(sorted(TERMS))}.", "")
    yield from ("| readings in | endings |", "| --- | --- |")
    endings: dict[str, list[str]] = {}
    for form in FORMATS:
        for what, held in form.promises.items():
            endings.setdefault(what or "other text, Excel", []).extend(held)
    for what, held in endings.items():
        yield f"| {what} | {listed(dict.fromkeys(held)) or 'by its content'} |"
    roles = [*ANGLES, *LABELS, *SIGNALS]
    yield from ("", f"Roles of columns: {listed(roles)}, and `head1` to `head99`.", "")
    yield f"Targets of `export` and `import`: {listed(TARGETS)}."
    yield ""


def simulations() -> Iterator[str]:
    """Tables and keys of a simulation file."""
    yield "## Simulation files"
    yield ""
    yield f"`[[run]]`: {listed(field.name for field in fields(RunDesign))}."
    yield ""
    yield from ("| `[[effect]] kind =` | keys |", "| --- | --- |")
    for kind, effect in sorted(EFFECTS.items()):
        yield f"| `{kind}` | {listed(field.name for field in fields(effect))} |"
    yield ""


#: Functions and types of an exported step that other programs call, after the name.
STEPS = r"(?:correct|correct_unwrapped|step|step_unwrapped|self_test)\("


def steps() -> Iterator[str]:
    """Signatures of exported steps."""
    yield from ("## Steps in C and Rust", "")
    saved = ROOT / "tests" / "python" / "model" / "saved" / "model-0.1.0-0550211.json"
    for target, begun in (("c", r"static inline [\w ]+ angle_"), ("rust", "pub fn ")):
        text = ta.export_model(saved, target).text
        yield f"```{target}"
        for found in re.findall(rf"^{begun}{STEPS}[^{{]*", text, re.MULTILINE):
            yield " ".join(found.split())
        yield from ("```", "")


def listed(words: object) -> str:
    """Words as code, separated by commas."""
    return ", ".join(f"`{word}`" for word in words)  # type: ignore[attr-defined]


def written(page: str) -> str:
    """The page with what the code has now."""
    before, rest = page.split(BEGIN)
    return before + BEGIN + "\n" + interface_text() + "\n" + END + rest.split(END)[1]


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
