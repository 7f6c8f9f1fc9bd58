"""Words that numbers decide: verdicts at their borders, digits of columns, lists of each once."""

import itertools

import numpy as np
import pytest

from trueangle.reports.wording import by_kind, conditions, gain_verdict, joined_list, listed_orders

SEED = 66_700


@pytest.mark.parametrize("low", [None, -3.0, 0.99, 1.01, 40.0])
@pytest.mark.parametrize("reduction", [-3.0, 0.99, 1.01, 60.0])
def test_a_gain_is_one_by_the_lower_end_of_its_interval(low, reduction):
    """By the reduction itself only where no interval is known; from one per cent on."""
    gain = {"reduction_percent": reduction, "reduction_low_percent": low}
    decisive = reduction if low is None else low
    wanted = "gain" if decisive > 1.0 else "no-gain"
    assert gain_verdict({"model": {}, "gain": gain}) == wanted
    assert gain_verdict({"model": None, "gain": gain}) == "no-model"
    assert gain_verdict({"model": {}, "gain": None}) == "unchecked"


def test_the_largest_of_a_condition_has_three_digits():
    """Of any sign, wherever it stands; what no run has is no column."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    keys = ("speed_deg_s", "temperature_C", "torque_Nm", "mount_deg")
    for _ in range(100):
        runs = [dict.fromkeys(keys) for _ in range(5)]
        largest = {}
        for key in keys[: int(rng.integers(0, 5))]:
            values = 10.0 ** rng.uniform(-2.5, 3.5, 4) * rng.choice([-1.0, 1.0], 4)
            for place, value in zip(rng.permutation(5)[:4], values.tolist(), strict=True):
                runs[place][key] = value
            largest[key] = float(np.abs(values).max())
        found = {column["key"]: column["digits"] for column in conditions(runs)}
        assert list(found) == list(largest)
        for key, digits in found.items():
            wanted = max(0, 2 - int(np.floor(np.log10(float(f"{largest[key]:.2e}")))))
            assert digits == wanted, largest[key]


def test_runs_of_a_fault_are_told_once():
    """Those of the first of its kind stand with it; of further ones what is new, in their order."""
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    for _ in range(50):
        faults = [
            {"fault": str(rng.choice(list("xyz"))),
             "runs": sorted(rng.choice(list("12345"), int(rng.integers(1, 4)), replace=False))}
            for _ in range(6)
        ]  # fmt: skip
        found = by_kind(faults)
        kinds = list(dict.fromkeys(fault["fault"] for fault in faults))
        assert [first["fault"] for first, _ in found] == kinds
        for kind, (first, others) in zip(kinds, found, strict=True):
            every = itertools.chain(*(f["runs"] for f in faults if f["fault"] == kind))
            assert not set(first["runs"]) & set(others)
            assert set(first["runs"]) | set(others) == set(every)


def test_orders_that_are_listed_are_those_kept_and_twenty_of_the_largest():
    print("seed", SEED + 2)
    rng = np.random.default_rng(SEED + 2)
    for count in (5, 60):
        rows = [
            {"retained": bool(rng.random() < 0.2),
             "amplitude_arcsec": None if rng.random() < 0.1 else float(rng.uniform(0.0, 9.0))}
            for _ in range(count)
        ]  # fmt: skip
        found = listed_orders(rows)
        assert found == sorted(set(found))
        kept = {i for i, row in enumerate(rows) if row["retained"]}
        others = set(range(count)) - kept
        assert kept <= set(found)
        assert len(set(found) - kept) == min(20, len(others))
        sizes = [rows[i]["amplitude_arcsec"] or 0.0 for i in range(count)]
        out = others - set(found)
        if out:
            assert max(sizes[i] for i in out) <= min(sizes[i] for i in set(found) - kept)
    assert [joined_list(list(range(1, n + 1))) for n in (1, 2, 3)] == ["1", "1 and 2", "1, 2 and 3"]
