"""Noise of encoders, and what a file of MuJoCo holds of them beside texts and numbers of others."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.simulators.mujoco import SensorLayer

A = np.pi / 648_000.0
NAMES = ("q0", "q1", "q2", "q3")


def robot(custom: str = "") -> mujoco.MjModel:
    bodies = "".join(f"<body><joint name='{name}'/><geom size='.1'/>" for name in NAMES)
    return mujoco.MjModel.from_xml_string(
        f"<mujoco>{custom}<worldbody>{bodies}{'</body>' * 4}</worldbody></mujoco>"
    )


def fragment(joint: str, arcsec: float, noise: float | None) -> str:
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [arcsec * A], [0.0])])
    text = ta.export_model(model, "mujoco", joint=joint, noise_std=noise).text
    return text.partition("<mujoco>")[2].rpartition("</mujoco>")[0]


#: Of others: names and numbers that are none of an encoder, before and behind.
FOREIGN = (
    "<custom><text name='note' data='q0'/><numeric name='gain' data='7'/></custom>",
    "<custom><text name='last' data='{}'/><numeric name='x' data='9'/></custom>",
)
#: Amplitude, arcsec, and noise, radians, of joints in an order that is not theirs.
HELD = {"q2": (30.0, 3e-4), "q0": (10.0, None), "q3": (40.0, 1e-4)}


@pytest.fixture(scope="module")
def held() -> mujoco.MjModel:
    parts = [fragment(name, *of) for name, of in HELD.items()]
    # Of a joint that has noise and no model.
    alone = "<custom><numeric name='trueangle_noise:q1' data='5e-4'/></custom>"
    return robot("".join((FOREIGN[0], alone, *parts, FOREIGN[1])))


def drawn(seed: int, shape: tuple[int, ...]) -> np.ndarray:
    """What numpy's own generator gives."""
    return np.random.default_rng(seed).normal(0.0, 1.0, shape)


def test_every_model_of_a_file_is_read_with_its_own_noise(held: mujoco.MjModel) -> None:
    data = mujoco.MjData(held)
    layer = SensorLayer(held)
    assert layer.names == tuple(HELD)
    errors = np.array([arcsec for arcsec, _ in HELD.values()]) * A
    stds = np.array([noise or 0.0 for _, noise in HELD.values()])
    wanted = errors + stds * drawn(0, (5, 3))
    np.testing.assert_allclose(layer.read([data] * 5), wanted, rtol=1e-12)


@pytest.mark.parametrize("std", [0.0, 2e-4])
def test_a_noise_that_is_given_is_that_of_all_joints(held: mujoco.MjModel, std: float) -> None:
    """In place of the file's, also none at all; with the seed, and new at every reading."""
    data = mujoco.MjData(held)
    layer = SensorLayer(held, noise_std=std, seed=5)
    errors = np.array([arcsec for arcsec, _ in HELD.values()]) * A
    left = np.concatenate([layer.read([data] * 2), layer.read(data)[None]]) - errors
    np.testing.assert_allclose(left, std * drawn(5, (3, 3)), rtol=1e-9, atol=1e-18)


def test_models_that_are_given_have_no_noise_of_the_file(held: mujoco.MjModel) -> None:
    data = mujoco.MjData(held)
    model = ta.HarmonicModel([], constant=0.25)
    assert SensorLayer(held, {"q2": model}).read(data) == [0.25]
    with pytest.raises(ArgumentError, match="models must name a joint at least"):
        SensorLayer(held, {})


@pytest.mark.parametrize("std", [-1e-9, float("nan"), float("inf")])
def test_a_noise_that_is_none_is_refused(held: mujoco.MjModel, std: float) -> None:
    with pytest.raises(ArgumentError, match=f"^noise_std must be 0 or more radians, got {std!r}$"):
        SensorLayer(held, noise_std=std, seed=3)


def test_the_first_of_several_numbers_is_the_noise() -> None:
    custom = "<custom><numeric name='trueangle_noise:q1' data='5e-4 8 9'/></custom>"
    mj = robot(custom + fragment("q1", 30.0, None))
    found = SensorLayer(mj).read([mujoco.MjData(mj)] * 4)
    np.testing.assert_allclose(found - 30.0 * A, 5e-4 * drawn(0, (4, 1)), rtol=1e-9)


def test_a_text_that_is_no_model_is_told_by_its_name() -> None:
    mj = robot(fragment("q1", 1.0, None) + "<custom><text name='trueangle:q2' data='{'/></custom>")
    with pytest.raises(ta.errors.FileError, match="trueangle:q2"):
        SensorLayer(mj)


def test_texts_and_numbers_without_a_name_are_of_nobody() -> None:
    spec = mujoco.MjSpec.from_string(
        "<mujoco><worldbody><body><joint name='q1'/><geom size='.1'/></body></worldbody></mujoco>"
    )
    spec.add_text(data="x")
    spec.add_numeric(data=[1.0])
    with pytest.raises(ArgumentError, match=r"or the file hold what `ta\.export_model"):
        SensorLayer(spec.compile())
