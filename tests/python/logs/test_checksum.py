"""Checksums: the same however cut, different after any damage."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from trueangle.formats.stored import Checksum


def checksum(*parts):
    found = Checksum()
    for part in parts:
        found.update(part)
    return found.text()


def slow(values):
    """The definition, in Python integers."""
    words = values.view(np.uint64).tolist()
    placed = sum(i * w for i, w in enumerate(words, 1))
    return f"{len(words)}:{sum(words) % 2**64:016x}:{placed % 2**64:016x}"


@given(st.integers(0, 200_000), st.lists(st.floats(0, 1), max_size=3), st.integers(0, 2**32 - 1))
def test_cuts_do_not_matter_and_the_sums_are_those_defined(rows, cuts, seed):
    values = np.random.default_rng(seed).normal(size=rows)
    parts = np.split(values, sorted(int(cut * rows) for cut in cuts))
    assert checksum(*parts) == checksum(values)
    if rows < 2000:
        assert checksum(values) == slow(values)


DAMAGE = {
    "a bit": lambda v: np.concatenate([v[:5], np.nextafter(v[5:6], 9.0), v[6:]]),
    "two exchanged": lambda v: v[[1, 0, *range(2, v.size)]],
    "one lost": lambda v: v[:-1],
    "one doubled": lambda v: np.concatenate([v, v[-1:]]),
    "one zeroed": lambda v: np.where(np.arange(v.size) == 3, 0.0, v),
    "sign of zero": lambda v: np.where(v == 0.0, -0.0, v),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damage_shows(damage):
    values = np.concatenate([np.random.default_rng(3).normal(size=1000), [0.0, np.nan]])
    assert checksum(DAMAGE[damage](values)) != checksum(values)
    assert checksum(values.copy()) == checksum(values)


@pytest.mark.parametrize("kind", [np.int8, np.uint16, np.float32, np.int64, np.complex128])
def test_items_of_any_width(kind):
    values = np.arange(100).astype(kind)
    assert checksum(values) == checksum(values[:30], values[30:])
    assert checksum(values) != checksum(values[::-1])
