"""Every allocation of the core fails once: a result as ever or a MemoryError, never an abort."""

import hashlib
import subprocess
import sys

import pytest

from .shim import NO_MEMORY

START = (
    "import numpy as np, trueangle as ta\nfrom trueangle import _core\n"
    "x = np.linspace(0.0, 360.0, 9000, endpoint=False)\n"
)
MODEL = "ta.HarmonicModel([ta.Shaft('output', 1, [1, 20], [1e-3] * 2, [0.0] * 2)], period=360.0"

#: What is computed, and printed to be compared with the same without a failure.
WORK = {
    "series": f"m = {MODEL})\nprint(m.error(x).sum(), m.correct(x).sum(), m.compensator()(3.0))",
    "terms": f"m = {MODEL}, terms=[ta.Backlash(0.1)])\nprint(m.correct(x).sum())",
    "fit": "s = _core.fit([(x, x + np.sin(x), None)], 360.0, [1.0], [list(range(1, 30))])\n"
    "print(s.cosine, s.residual_variance)",
    "qr": "y = np.ascontiguousarray(x[::10])\n"
    "s = _core.fit([(y, y + np.sin(y), None)], 360.0, [1.0], "
    "[list(range(1, 20))], method='qr')\nprint(s.cosine, s.residual_variance)",
    "moments": "m = ta.Moments(range(1, 20), period=360.0)\nm.update(x, np.sin(x))\n"
    "m.merge(m.copy())\nprint(m.count, m.solve().cosine.tolist())",
}

#: At most so many of the allocations of each are tried, spread over all.
TRIED = 120


@pytest.mark.parametrize("what", WORK)
def test_the_nth_allocation_fails(what, driver, desk):
    code = START + WORK[what]
    whole = driver.run(desk, code=code)
    assert whole.status == 0, whole.told
    total = whole.counts["allocate"]
    assert total > 20
    first = int.from_bytes(hashlib.sha256(what.encode()).digest()[:1]) % 2
    gentle = 0
    for n in range(first, total, max(1, total // TRIED)):
        found = driver.run(desk, code=code, kind="allocate", n=n, error=NO_MEMORY)
        assert found.status in (0, 12), (n, found)
        if found.status == 0:
            assert found.told == whole.told, n
        gentle += 1
    assert gentle >= 20


#: Before long work, a shorter one that makes what is made once; the result has a place already.
LONG = f"m = {MODEL})\nm.error(x[:9], path='direct')\ny = np.tile(x, 400)\n"


def test_long_work_ends_where_it_lives_on_the_reserve(driver, desk):
    before = driver.run(desk, code=START + LONG)
    assert before.status == 0, before.told
    code = START + LONG + (
        "try:\n    m.error(y, out=y, path='direct', threads=1)\n"
        "except MemoryError as error:\n    print(error)\n    raise\n"
    )  # fmt: skip
    # The first may fail before the work has filled the reserve again; one of the next is its own.
    first = before.counts["allocate"]
    for n in range(first, first + 4):
        found = driver.run(desk, code=code, kind="allocate", n=n, error=NO_MEMORY)
        assert found.status in (0, 12), found
        if "memory ran short while" in found.told:
            return
    pytest.fail(f"the work went on without a reserve: {found}")


#: Leaves so many addresses beyond those in use, before the work; status 12 for a MemoryError.
#: Done once before, so that Python has imported what it needs: its own imports end otherwise.
TIGHT = """
exec({work!r})
pages = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
resource.setrlimit(resource.RLIMIT_AS, (pages + {extra}, resource.RLIM_INFINITY))
try:
    exec({work!r})
except MemoryError:
    sys.exit(12)
"""


@pytest.mark.parametrize("extra", [0, 1 << 18, 5 << 20])
@pytest.mark.parametrize("what", WORK)
def test_a_process_that_gets_no_more_memory_goes_on_or_says_so(what, extra):
    code = "import resource, sys\n" + START + TIGHT.format(extra=extra, work=WORK[what])
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode in (0, 12), (done.returncode, done.stderr[-500:])


def test_a_thread_that_does_not_start_is_done_without(driver, desk):
    code = (
        "import numpy as np, trueangle as ta, trueangle._core as _core\n"
        "x = np.linspace(0.0, 3600.0, 400_000)\n"
        f"m = {MODEL})\n"
        "print(m.correct(x, threads=4).tobytes() == m.correct(x, threads=1).tobytes())"
    )
    for n in range(-1, 5):
        found = driver.run(desk, code=code, kind="thread", n=n, error=11)
        assert (found.status, found.told) == (0, "True\n"), n
        assert found.counts["thread"] > max(0, min(n, 0))
