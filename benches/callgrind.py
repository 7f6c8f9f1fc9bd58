"""Instructions that the kernels execute, counted by callgrind and held against a reference.

    python benches/callgrind.py            # compare; exit status 1 beyond 3 %
    python benches/callgrind.py --update   # keep the counts as the new reference

Counts do not depend on how busy a machine is. valgrind emulates AVX2 at most, so every
path is forced to an instruction set it knows. Needs valgrind and
`cargo build --release --example kernels`.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parent.parent
PROGRAM = ROOT / "target" / "release" / "examples" / "kernels"
REFERENCE = Path(__file__).with_suffix(".json")

#: Relative growth that fails: compilers move counts by a percent or two.
ALLOWED = 0.03

#: Samples of the long run and the short one; their difference leaves out the set-up.
LONG, SHORT = 40_000, 8_000


def instructions(case: str, samples: int) -> int:
    with tempfile.NamedTemporaryFile() as file:
        found = subprocess.run(
            [
                "valgrind",
                "--tool=callgrind",
                f"--callgrind-out-file={file.name}",
                PROGRAM,
                case,
                str(samples),
            ],
            capture_output=True,
            text=True,
            check=False,
        )
    total = re.search(r"Collected : (\d+)", found.stderr)
    if found.returncode != 0 or total is None:
        sys.exit(f"callgrind of {case} failed:\n{found.stderr}")
    return int(total.group(1))


def per_sample(case: str) -> float:
    difference = instructions(case, LONG) - instructions(case, SHORT)
    return round(difference / (LONG - SHORT), 2)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--update", action="store_true", help="keep the counts")
    args = parser.parse_args()
    subprocess.run(["cargo", "build", "--release", "--example", "kernels"], cwd=ROOT, check=True)
    cases = subprocess.run([PROGRAM], capture_output=True, text=True, check=True).stdout.split()
    counts = {case: per_sample(case) for case in cases}
    if args.update:
        REFERENCE.write_text(json.dumps(counts, indent=2) + "\n")
    reference = json.loads(REFERENCE.read_text())
    worse = False
    for case, count in counts.items():
        kept = reference.get(case)
        change = float("nan") if kept is None else count / kept - 1.0
        mark = " <-- more" if change > ALLOWED else ""
        worse |= bool(mark)
        print(f"{case:28s} {count:9.2f} instructions per sample, {change:+.1%}{mark}")
    return int(worse)


if __name__ == "__main__":
    sys.exit(main())
