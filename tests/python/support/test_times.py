"""Times of texts: days as their own zone counts them, seconds whatever the zone."""

from datetime import UTC, datetime, timedelta, timezone

import numpy as np

from trueangle.formats import seriallog
from trueangle.formats.format import Selection
from trueangle.support.times import elapsed_seconds, local_day

SEED = 5_150


def test_a_day_is_that_of_the_texts_own_zone():
    """The first ten letters, whatever the zone and however near to midnight."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    start = datetime(2026, 2, 27)
    for _ in range(300):
        clock = start + timedelta(seconds=int(rng.integers(0, 4 * 86400)))
        zone = timezone(timedelta(minutes=15 * int(rng.integers(-48, 57))))
        for text in (clock.isoformat(), clock.replace(tzinfo=zone).isoformat(" ")):
            assert local_day(text) == text[:10], text


def test_seconds_do_not_depend_on_the_zone_that_they_are_written_in():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    start = datetime(2026, 12, 31, 22, tzinfo=UTC)
    wanted = np.append(0.0, rng.uniform(-1e5, 1e5, 200).round(6))
    texts = []
    for seconds in wanted.tolist():
        zone = timezone(timedelta(minutes=15 * int(rng.integers(-48, 57))))
        texts.append((start + timedelta(seconds=seconds)).astimezone(zone).isoformat())
    found, wrong = elapsed_seconds(texts)
    assert wrong is None
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    # One without a zone cannot be told from them.
    for place in (1, 7, 200):
        mixed = [*texts]
        mixed[place] = mixed[place][:19]
        assert elapsed_seconds(mixed)[1] == place


def test_a_clock_that_is_set_back_is_not_midnight(tmp_path):
    """Of a terminal: days and nights pass, and now and then it is put right by some seconds."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    for draw in range(5):
        # Half an hour from reading to reading, and a few corrections apart from midnight.
        seconds = 1800.0 * np.arange(1, 150) + rng.uniform(0.0, 600.0, 149).round(3)
        for place in rng.choice(np.flatnonzero(seconds % 86400.0 > 7200.0), 8, replace=False):
            seconds[place] = seconds[place - 1] - round(rng.uniform(0.5, 60.0), 3)
        clocks = seconds % 86400.0
        lines = [
            f"{t // 3600:02.0f}:{t // 60 % 60:02.0f}:{t % 60:06.3f} -> a:1,b:{i}"
            for i, t in enumerate(clocks.tolist())
        ]
        path = tmp_path / f"{draw}.log"
        path.write_text("\n".join(lines) + "\n")
        (batch,) = seriallog.read(path, Selection(["time_s", "b"]))
        found = batch["time_s"] - batch["time_s"][0]
        np.testing.assert_allclose(found, seconds - seconds[0], atol=2e-3)
