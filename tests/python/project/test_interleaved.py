"""What a benchmark tells of rounds: their median, the least and the most."""

import itertools
import sys

from conftest import ROOT

sys.path.insert(0, str(ROOT / "benches"))

from harness import interleaved


def test_one_slow_round_does_not_move_the_median(monkeypatch):
    """Rounds of 3, 1, 20, 2 and 4 s of each way, by a clock that only the ways move."""
    now, order = [0.0], []

    def way(name):
        rounds = itertools.chain([100.0], (3.0, 1.0, 20.0, 2.0, 4.0))

        def work():
            order.append(name)
            now[0] += next(rounds)

        return work

    monkeypatch.setattr(interleaved.time, "perf_counter", lambda: now[0])
    found = interleaved.interleave({"a": way("a"), "b": way("b")}, 5)
    for timing in found.values():
        assert (timing.median, timing.least, timing.most) == (3.0, 1.0, 20.0)
    # Once each without counting, then in turn.
    assert order == ["a", "b"] * 6
