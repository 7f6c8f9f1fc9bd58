"""The kinds of runs that limits allow: loads, speeds and temperatures a rig may be asked for."""

from __future__ import annotations

import itertools

import pytest

from trueangle.planning import Limits
from trueangle.planning.further import plainest_run, run_choices


@pytest.mark.parametrize("gravity", [0.0, 3.0])
@pytest.mark.parametrize("torque", [(0.0, 0.0), (2.0, 5.0), (-5.0, -2.0), (-2.0, 5.0)])
def test_loads_are_the_least_and_the_extremes_and_a_weight_hangs_alone(torque, gravity) -> None:
    limits = Limits(torque_Nm=torque, gravity_Nm=gravity)
    kinds = [kind for kind in run_choices(limits) if "torque_Nm" in kind[0]]
    if torque[0] == torque[1] and not gravity:
        assert not kinds
        return
    (loads,) = kinds
    pairs = [(choice["torque_Nm"], choice["gravity_Nm"]) for choice in loads]
    least = min(torque, key=abs) if torque[0] * torque[1] > 0.0 else 0.0
    assert pairs[0] == (least, 0.0)
    assert plainest_run(limits, "x").torque_Nm == least
    hung = [(0.0, gravity)] if gravity else []
    assert sorted(pairs) == sorted({(load, 0.0) for load in (least, *torque)} | set(hung))
    assert len(set(pairs)) == len(pairs)


@pytest.mark.parametrize("slow", [5.0, 20.0, 60.0])
def test_speeds_are_both_ends_and_the_middle_and_a_coast_stays_within(slow) -> None:
    limits = Limits(speed_deg_s=(slow, 60.0))
    (speeds,) = (kind for kind in run_choices(limits) if "speed_deg_s" in kind[0])
    steady = [c["speed_deg_s"] for c in speeds if c["speed_end_deg_s"] is None]
    coasts = [c["speed_end_deg_s"] for c in speeds if c["speed_end_deg_s"] is not None]
    assert steady[0] == 60.0
    assert {slow, 60.0} <= set(steady)
    assert all(slow <= speed <= 60.0 for speed in steady)
    assert coasts == ([max(15.0, slow)] if slow < 60.0 else [])


@pytest.mark.parametrize(("cold", "warm"), [(20.0, 20.0), (15.0, 40.0)])
def test_temperatures_are_both_ends_and_the_way_between(cold, warm) -> None:
    limits = Limits(temperature_C=(cold, warm))
    kinds = [kind for kind in run_choices(limits) if "temperature_C" in kind[0]]
    told = [(c["temperature_C"], c["temperature_end_C"]) for c in itertools.chain(*kinds)]
    assert told == ([(cold, None), (warm, None), (cold, warm)] if cold < warm else [])


@pytest.mark.parametrize("with_current", [True, False])
def test_mounts_and_currents_are_asked_for_where_there_are_several(with_current) -> None:
    limits = Limits(mount_deg=(0.0, 130.0), current_A=(0.0, 2.0))
    kinds = [*run_choices(limits, with_current)]
    assert [{"mount_deg": 0.0}, {"mount_deg": 130.0}] in kinds
    assert ([{"current_A": 0.0}, {"current_A": 2.0}] in kinds) == with_current
    one = [*run_choices(Limits(mount_deg=(40.0,), current_A=(1.0, 1.0)))]
    assert not any({"mount_deg", "current_A"} & {*kind[0]} for kind in one)
