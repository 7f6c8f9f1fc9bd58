"""Readings of encoders in MuJoCo: the angle error of each joint put on its true angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ArgumentError, MissingSignalError
from ..export.mujoco import TEXT_NAME
from ..model.file import model_of
from ..model.model import HarmonicModel
from ..support.suggestions import did_you_mean

if TYPE_CHECKING:
    from mujoco import MjModel

__all__ = ["SensorLayer"]

Array = NDArray[np.float64]

#: Radians within which the reading of a model at its indicated angle is found, and steps to it.
_SOLVED = 1e-13
_STEPS = 100


class SensorLayer:
    r"""What the encoders of joints would say: true angles of MuJoCo with their errors.

    .. math:: r_j = \theta_j + \varepsilon_j(\theta_j, \dot\theta_j, \tau_j, \ldots)

    MuJoCo has no harmonic error of a sensor, and no play that leaves the joint alone; models
    of trueangle have both, with the state that play and hysteresis need. A joint's velocity is
    its ``qvel``, its torque the sum of its actuators (``qfrc_actuator``).

    Parameters
    ----------
    mjmodel : mujoco.MjModel
    models : mapping of str to HarmonicModel, optional
        By joint, or by ``jointpos`` sensor, whose own delay and noise are then in the reading; a
        `trueangle.Robot` is one. Without, those that ``ta.export_model(model, "mujoco")``
        has put into the file.
    noise_std : float, optional
        Standard deviation of white noise of every reading, radians.
    seed : int, optional
        Of the noise.

    Attributes
    ----------
    names : tuple of str
        In the order of the mapping, and of readings.

    Raises
    ------
    ArgumentError
        A name that the model does not have, or a joint that does not turn.

    Notes
    -----
    Each call of `read` is one reading: what follows travel takes them in their order. A layer
    belongs to as many environments as the first `read` shows; `reset` forgets them. Models
    without a state are evaluated over all environments at once (0.02 microseconds a reading of
    1000), those with a state one by one (3.4 microseconds); one environment takes 10 to 16.
    Angles that turn further than half a turn from one reading to the next are counted wrongly
    by models with a state.

    Examples
    --------
    >>> import mujoco, numpy as np, trueangle as ta
    >>> from trueangle.simulators.mujoco import SensorLayer
    >>> mj = mujoco.MjModel.from_xml_string(
    ...     "<mujoco><worldbody><body><joint name='elbow'/><geom size='.1'/></body></worldbody>"
    ...     "</mujoco>")
    >>> data = mujoco.MjData(mj)
    >>> eccentric = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.002])])
    >>> layer = SensorLayer(mj, {"elbow": eccentric})
    >>> data.qpos[0] = np.pi / 2
    >>> layer.read(data) - np.pi / 2
    array([0.002])
    """

    def __init__(
        self,
        mjmodel: MjModel,
        models: Mapping[str, HarmonicModel] | None = None,
        *,
        noise_std: float = 0.0,
        seed: int = 0,
    ) -> None:
        found = _embedded(mjmodel) if models is None else dict(models)
        if not found:
            raise ArgumentError(
                "models must name a joint at least, or the file hold what `ta.export_model(model, "
                '"mujoco")` writes'
            )
        if not (np.isfinite(noise_std) and noise_std >= 0.0):
            raise ArgumentError(f"noise_std must be 0 or more radians, got {noise_std!r}")
        self.names = tuple(found)
        self._joints = [_Encoder(mjmodel, name, model) for name, model in found.items()]
        self._noise_std = float(noise_std)
        self._random = np.random.default_rng(seed)

    def read(self, data: Any, **signals: ArrayLike) -> Array:
        """Readings of the joints, radians.

        Parameters
        ----------
        data : mujoco.MjData, a sequence of them, or anything with ``qpos`` and ``qvel``
            One environment, or E of them: also with arrays of shape (E, nq), as batches have.
        **signals : float or array_like, optional
            ``temperature`` (degrees Celsius), ``current`` (A), and ``torque`` (Nm) or
            ``velocity`` (rad/s) in place of MuJoCo's: of the shape of the result or broadcast
            to it.

        Returns
        -------
        ndarray, shape (J,) or (E, J)

        Raises
        ------
        MissingSignalError
            A model needs a temperature or a current.
        """
        batch = isinstance(data, Sequence)
        fields = {
            name: np.stack([np.asarray(getattr(one, name), np.float64) for one in data])
            if batch
            else np.asarray(getattr(data, name), np.float64)
            for name in ("qpos", "qvel", "qfrc_actuator", "sensordata")
            if hasattr(data[0] if batch else data, name)
        }
        single = fields["qpos"].ndim == 1
        fields = {name: np.atleast_2d(values) for name, values in fields.items()}
        shape = (len(fields["qpos"]), len(self._joints))
        given = {name: np.broadcast_to(value, shape) for name, value in _known(signals).items()}
        readings = np.empty(shape)
        for j, joint in enumerate(self._joints):
            own = {name: values[:, j] for name, values in given.items()}
            readings[:, j] = joint.read(fields, own)
        if self._noise_std:
            readings += self._random.normal(0.0, self._noise_std, shape)
        return readings[0] if single else readings

    def reset(self, environments: ArrayLike | None = None) -> None:
        """Forget the travel of all environments, or of some: a mask, or their numbers."""
        for joint in self._joints:
            joint.reset(environments)


class _Encoder:
    """One joint: where MuJoCo keeps its angle, its model and the state of every environment."""

    def __init__(self, mjmodel: MjModel, name: str, model: HarmonicModel) -> None:
        import mujoco

        if not isinstance(model, HarmonicModel):
            raise ArgumentError(
                f"models[{name!r}] must be a HarmonicModel, got {type(model).__name__}: of a fit "
                "take .model"
            )
        kinds = mujoco.mjtObj
        joint = mujoco.mj_name2id(mjmodel, kinds.mjOBJ_JOINT, name)
        sensor = mujoco.mj_name2id(mjmodel, kinds.mjOBJ_SENSOR, name)
        self._field, self._at = "qpos", 0
        if joint < 0 and sensor >= 0:
            if mjmodel.sensor_type[sensor] != mujoco.mjtSensor.mjSENS_JOINTPOS:
                raise ArgumentError(f"sensor {name!r} is no jointpos: it reads no joint's angle")
            joint = int(mjmodel.sensor_objid[sensor])
            self._field, self._at = "sensordata", int(mjmodel.sensor_adr[sensor])
        if joint < 0:
            names = [mjmodel.joint(i).name for i in range(mjmodel.njnt)]
            raise ArgumentError(
                f"the model has no joint {name!r}{did_you_mean(name, names)}; it has "
                f"{', '.join(names) or 'none'}"
            )
        if mjmodel.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            raise ArgumentError(f"joint {name!r} is no hinge: its position is no angle")
        if self._field == "qpos":
            self._at = int(mjmodel.jnt_qposadr[joint])
        self._dof = int(mjmodel.jnt_dofadr[joint])
        self._name, self._model = name, model
        self._unit = model.period / (2.0 * np.pi)
        self._states: list[Any] = []

    def read(self, fields: Mapping[str, Array], given: Mapping[str, Array]) -> Array:
        angle = fields[self._field][:, self._at] * self._unit
        own = {"velocity": "qvel", "torque": "qfrc_actuator"}
        signals: dict[str, Array] = {}
        for name in self._model.uses_signals:
            if name in given:
                signals[name] = given[name]
            elif own.get(name) in fields:
                signals[name] = fields[own[name]][:, self._dof]
        if "velocity" in signals:
            signals["velocity"] = signals["velocity"] * self._unit
        missing = [name for name in self._model.signals if name not in {*signals, "direction"}]
        if missing:
            raise MissingSignalError(
                f"the model of joint {self._name!r} needs {missing[0]}, which MuJoCo does not "
                f"have: give read(data, {missing[0]}=...)"
            )
        if not self._model.follows_travel:
            core = self._model._core_corrector()
            return np.asarray(self._reading(core, angle, signals) / self._unit)
        if len(self._states) != len(angle):
            if self._states:
                raise ArgumentError(
                    f"{len(self._states)} environments were read before, and {len(angle)} now: "
                    "their travel is not known; call reset() before"
                )
            self._states = [self._model._core_corrector() for _ in angle]
        readings = [
            self._reading(core, angle[e : e + 1], {k: v[e : e + 1] for k, v in signals.items()})[0]
            for e, core in enumerate(self._states)
        ]
        return np.array(readings) / self._unit

    def _reading(self, core: Any, angle: Array, signals: Mapping[str, Array]) -> Array:
        if self._model.argument == "reference":
            return np.asarray(angle + core.error(angle, **signals), np.float64)
        # The error is one of the reading, which is looked for from the same past.
        past = core.store()
        reading = angle.copy()
        for _ in range(_STEPS):
            core.restore(past)
            found: Array = np.asarray(angle + core.error(reading, **signals))
            moved = float(np.max(np.abs(found - reading), initial=0.0))
            reading = found
            if moved <= _SOLVED * self._unit:
                return reading
        raise ArgumentError(
            f"the model of joint {self._name!r} gives no reading of its true angle: its error at "
            'the indicated angle is too steep; fit it with `argument="reference"`'
        )

    def reset(self, environments: ArrayLike | None) -> None:
        if environments is None:
            self._states = []
        elif self._states:
            chosen = np.arange(len(self._states))[np.asarray(environments)]
            for e in np.atleast_1d(chosen):
                self._states[e].reset()


def _known(signals: Mapping[str, ArrayLike]) -> dict[str, Array]:
    known = ("velocity", "torque", "temperature", "current")
    for name in signals:
        if name not in known:
            raise ArgumentError(
                f"there is no signal `{name}=`{did_you_mean(name, known)}; there are "
                f"{', '.join(known)}"
            )
    return {name: np.asarray(value, np.float64) for name, value in signals.items()}


def _embedded(mjmodel: MjModel) -> dict[str, HarmonicModel]:
    """Models that the file holds, by joint."""
    import mujoco

    found = {}
    for i in range(mjmodel.ntext):
        name = mujoco.mj_id2name(mjmodel, mujoco.mjtObj.mjOBJ_TEXT, i) or ""
        if name.startswith(TEXT_NAME):
            start, size = int(mjmodel.text_adr[i]), int(mjmodel.text_size[i])
            raw = bytes(mjmodel.text_data[start : start + size]).rstrip(b"\0")
            found[name[len(TEXT_NAME) :]] = model_of(raw.decode("utf-8"), name)
    return found
