"""Blocks of a log that are kept: the same however it comes, so many, and from all of it."""

import numpy as np
import pytest

from trueangle.logs.keeping import KeptReadings

SEED = 71_300
BLOCK = 256
ROWS = 400 * BLOCK + 77
X = np.arange(ROWS, dtype=np.float64)


def kept_of(cuts, most=1 << 30, part=1.0, salt=3):
    """What is kept of a log that comes in batches, each beginning where a block does."""
    kept = KeptReadings(most, part)
    for begin, end in zip([0, *cuts], [*cuts, ROWS], strict=True):
        kept.take("run", salt, begin, X[begin:end], -X[begin:end])
    return kept


def places(kept):
    return [int(x[0]) // BLOCK for _, x, _ in kept.blocks["run"]]


@pytest.mark.parametrize("part", [0.5, 0.1])
@pytest.mark.parametrize("salt", [0, 3, 1_000_000])
def test_it_does_not_depend_on_batches(part, salt):
    """At once, block by block, and in batches of unlike numbers of blocks."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    whole = places(kept_of([], part=part, salt=salt))
    every = [BLOCK * k for k in range(1, 401)]
    some = sorted(rng.choice(every, 40, replace=False).tolist())
    for cuts in (every, some, every[::7]):
        kept = kept_of(cuts, part=part, salt=salt)
        assert places(kept) == whole
        x, y = kept.columns("run")
        assert kept.readings == x.size
        np.testing.assert_array_equal(x, -y)
    # A share of all, from every part of the log and from no neighbours more than chance makes.
    assert whole[0] == 0
    for quarter in range(4):
        count = sum(100 * quarter <= k < 100 * quarter + 100 for k in whole)
        assert abs(count - 100 * part) < 4.5 * np.sqrt(100 * part * (1.0 - part)) + 1.0
    pairs = np.count_nonzero(np.diff(whole) == 1)
    assert abs(pairs - 400 * part**2) < 5.0 * np.sqrt(400 * part**2) + 2.0


def test_segments_of_a_log_are_unlike():
    first, second = (set(places(kept_of([], part=0.2, salt=salt))) for salt in (0, 1))
    alike = len(first & second) - 1  # the first block of each is kept anyway
    assert alike < 0.04 * 400 + 5.0 * np.sqrt(0.04 * 400)


@pytest.mark.parametrize("most", [60 * BLOCK, 7 * BLOCK, BLOCK // 2])
def test_half_of_the_blocks_go_until_they_are_few_enough(most):
    """Against the rule written out over all blocks, however the log comes."""
    every = {int(x[0]) // BLOCK: (chance, x.size) for chance, x, _ in kept_of([]).blocks["run"]}
    part = 1.0
    while True:
        left = [k for k, (chance, _) in every.items() if k == 0 or chance < part]
        if sum(every[k][1] for k in left) <= most or len(left) == 1:
            break
        part /= 2.0
    for cuts in ([], [BLOCK * k for k in range(1, 401)], [BLOCK * 199]):
        kept = kept_of(cuts, most=most)
        assert (places(kept), kept.part) == (left, part)
        assert kept.readings == sum(every[k][1] for k in left)


def test_segments_that_were_thinned_unlike_are_one_sample():
    """The share of the one of which less was kept holds for all that follows."""
    one, other = kept_of([], most=50 * BLOCK, salt=0), kept_of([], most=200 * BLOCK, salt=1)
    least = min(one.part, other.part)
    assert one.part != other.part
    for first, second in ((0, 1), (1, 0)):
        parts = [kept_of([], most=50 * BLOCK, salt=0), kept_of([], most=200 * BLOCK, salt=1)]
        parts[first].add(parts[second])
        assert parts[first].part == least
        assert parts[first].readings == one.readings + other.readings
        found = parts[first].thinned(20 * BLOCK)
        assert found.readings <= 20 * BLOCK
        chances = [chance for chance, _, _ in found.blocks["run"][1:]]
        assert max(chances) < found.part < least


def test_readings_that_are_missing_take_no_place():
    kept, x = KeptReadings(1 << 30), X.copy()
    x[10:300] = np.nan
    y = -X
    y[5000:6000] = np.nan
    kept.take("run", 0, 0, x, y)
    known = np.isfinite(x) & np.isfinite(y)
    np.testing.assert_array_equal(
        np.column_stack(kept.columns("run")), np.column_stack([x, y])[known]
    )
    assert kept.readings == np.count_nonzero(known)
