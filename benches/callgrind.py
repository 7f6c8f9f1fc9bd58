"""Instructions that the kernels and a step from Python execute, against a reference.

    python benches/callgrind.py            # compare; exit status 1 beyond 3 % up or down
    python benches/callgrind.py --update   # keep the counts as the new reference

Counts by callgrind do not depend on how busy a machine is. valgrind emulates AVX2 at most, so
every path is forced to an instruction set it knows. A step is called by ``map``, and what
``math.fabs`` costs there is subtracted: the same interpreter calls both. More instructions are
a loss, fewer a reference that no longer shows one. Needs valgrind, cargo, and a trueangle that
this interpreter finds.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROGRAM = ROOT / "target" / "release" / "examples" / "kernels"
REFERENCE = Path(__file__).with_suffix(".json")

#: Relative change that fails: compilers move counts by a percent or two.
ALLOWED = 0.03

#: Instructions by which a step may change: other interpreters make floats in a few more or less.
#: A reference counter, a lock or a wrapped call costs 20 and more.
ALLOWED_OF_STEP = 12.0

#: Samples of the long run and the short one; their difference leaves out the set-up.
LONG, SHORT = 40_000, 8_000

#: Calls of a function of one float; without numpy, whose import takes long to emulate.
CALLS = """
import collections, math, sys
from trueangle._core import Compensator, Series
k = [*range(1, 18)]
sizes = [[[1e-5 * f(i) for i in k]] for f in (math.cos, math.sin)]
step = Compensator(Series(2.0 * math.pi, 0.0, [1.0], [k], *sizes)).step
collections.deque(map({function}, [0.7] * int(sys.argv[1])), maxlen=0)
"""


def instructions(words: list[str | Path]) -> int:
    with tempfile.NamedTemporaryFile() as file:
        found = subprocess.run(
            [
                "valgrind",
                "--tool=callgrind",
                f"--callgrind-out-file={file.name}",
                *words,
            ],
            capture_output=True,
            text=True,
            check=False,
            # The same start-up, so that it is left out to the last instruction.
            env={**os.environ, "PYTHONHASHSEED": "0", "OPENBLAS_NUM_THREADS": "1"},
        )
    total = re.search(r"Collected : (\d+)", found.stderr)
    if found.returncode != 0 or total is None:
        sys.exit(f"callgrind of {words} failed:\n{found.stderr}")
    return int(total.group(1))


def per_sample(*words: str | Path) -> float:
    """Instructions of one sample more."""
    long, short = (instructions([*words, str(samples)]) for samples in (LONG, SHORT))
    return round((long - short) / (LONG - SHORT), 2)


def per_call(function: str) -> float:
    """Instructions of one call from Python, with those of ``map``."""
    return per_sample(sys.executable, "-c", CALLS.format(function=function))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="keep the counts")
    args = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "--example", "kernels"], cwd=ROOT, check=True)
    cases = subprocess.run([PROGRAM], capture_output=True, text=True, check=True).stdout.split()
    counts = {case: per_sample(PROGRAM, case) for case in cases}
    calls = {name: per_call(name) for name in ("step", "math.fabs", "math.sin")}
    counts["step-from-python"] = round(calls["step"] - calls["math.fabs"], 2)
    if args.update:
        REFERENCE.write_text(json.dumps(counts, indent=2) + "\n")
    reference = json.loads(REFERENCE.read_text())
    wrong = counts.keys() != reference.keys()
    for case, count in counts.items():
        kept = reference.get(case, float("nan"))
        allowed = ALLOWED_OF_STEP if case == "step-from-python" else ALLOWED * kept
        mark = "" if abs(count - kept) <= allowed else f" <-- not {kept:.2f} +- {allowed:.2f}"
        wrong |= bool(mark)
        print(f"{case:28s} {count:9.2f} instructions per sample{mark}")
    told = ", ".join(f"{name} {count:.1f}" for name, count in calls.items())
    print(f"calls by map: {told}")
    return int(wrong)


if __name__ == "__main__":
    sys.exit(main())
