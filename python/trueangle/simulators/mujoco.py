"""Readings of encoders in MuJoCo: the angle error of each joint put on its true angle."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import trueangle._core as _core

from ..errors import ArgumentError, MissingSignalError
from ..export.mujoco import NOISE_NAME, TEXT_NAME
from ..model.file import embedded_model
from ..model.model import HarmonicModel
from ..support.arrays import Array
from ..support.signals import coupled_joint
from ..support.suggestions import did_you_mean

if TYPE_CHECKING:
    from mujoco import MjModel


class SensorLayer:
    """What the encoders of joints would read: true angles of MuJoCo with their errors.

    ::

        r_j = θ_j + ε_j(θ_j, θ̇_j, τ_j, ...)

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
        Standard deviation of white noise of every reading, radians; by default that of each
        joint in the file, where the models are taken from it, else none.
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
    has as many environments as the first `read` has; `reset` clears their travel. All
    environments are read at once, also by models with a state. Angles that turn further than
    half a turn from one reading to the next are counted wrongly by models with a state. A joint
    that is coupled to another one takes its reading, where that is in the layer; else its angle.
    Readings count as the joint does: the sensor of a model whose ``indicated_sign`` is -1 reads
    minus them.

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
        noise_std: float | None = None,
        seed: int = 0,
    ) -> None:
        found = _embedded(mjmodel) if models is None else dict(models)
        if not found:
            raise ArgumentError(
                "models must name a joint at least, or the file hold what `ta.export_model(model, "
                '"mujoco")` writes'
            )
        if noise_std is not None and not (np.isfinite(noise_std) and noise_std >= 0.0):
            raise ArgumentError(f"noise_std must be 0 or more radians, got {noise_std!r}")
        self.names = tuple(found)
        self._joints = [_Encoder(mjmodel, name, model) for name, model in found.items()]
        self._order = self._couplings(mjmodel)
        noise = _embedded_noise(mjmodel) if models is None else {}
        each = [noise.get(name, 0.0) if noise_std is None else noise_std for name in self.names]
        self._noise_std = np.array(each, np.float64)
        self._random = np.random.default_rng(seed)

    def _couplings(self, mjmodel: MjModel) -> list[tuple[int, dict[str, tuple[str | None, int]]]]:
        """Joints in an order in which each has the readings that it is coupled to.

        With each, where the other joints' angles are: among the readings, or in ``qpos`` by name.
        """
        wanted = {
            j: {name: coupled_joint(name) for name in joint.model.signals if coupled_joint(name)}
            for j, joint in enumerate(self._joints)
        }
        places = {joint.joint: j for j, joint in enumerate(self._joints)}
        order: list[tuple[int, dict[str, tuple[str | None, int]]]] = []
        while wanted:
            done = {j for j, _ in order}
            ready = [
                j
                for j, names in wanted.items()
                if all(places.get(o or "", -1) in {*done, -1} for o in names.values())
            ]
            if not ready:
                raise ArgumentError(
                    f"joints {', '.join(self.names[j] for j in wanted)} are coupled in a circle: "
                    "none of them can be read first"
                )
            for j in ready:
                found: dict[str, tuple[str | None, int]] = {}
                for name, other in wanted.pop(j).items():
                    assert other is not None
                    if other in places:
                        found[name] = None, places[other]
                    else:
                        found[name] = other, _Encoder(mjmodel, other, self._joints[j].model).at
                order.append((j, found))
        return order

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
        readings = np.empty(shape[::-1]).T  # a joint's are side by side
        for j, couplings in self._order:
            own = {name: values[:, j] for name, values in given.items()}
            for signal, (name, at) in couplings.items():
                own[signal] = readings[:, at] if name is None else fields["qpos"][:, at]
            self._joints[j].read(fields, own, readings[:, j])
        if self._noise_std.any():
            readings += self._random.normal(0.0, self._noise_std, shape)
        return readings[0] if single else readings

    def reset(self, environments: ArrayLike | None = None) -> None:
        """Clear the travel of all environments, or of some: a mask, or their numbers."""
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
        self._field, self.at = "qpos", 0
        if joint < 0 and sensor >= 0:
            if mjmodel.sensor_type[sensor] != mujoco.mjtSensor.mjSENS_JOINTPOS:
                raise ArgumentError(f"sensor {name!r} is not a jointpos: it reads no joint's angle")
            joint = int(mjmodel.sensor_objid[sensor])
            self._field, self.at = "sensordata", int(mjmodel.sensor_adr[sensor])
        if joint < 0:
            names = [mjmodel.joint(i).name for i in range(mjmodel.njnt)]
            raise ArgumentError(
                f"the model has no joint {name!r}; it has "
                f"{', '.join(names) or 'none'}{did_you_mean(name, names)}"
            )
        if mjmodel.jnt_type[joint] != mujoco.mjtJoint.mjJNT_HINGE:
            raise ArgumentError(f"joint {name!r} is not a hinge: its position is not an angle")
        if self._field == "qpos":
            self.at = int(mjmodel.jnt_qposadr[joint])
        self._dof = int(mjmodel.jnt_dofadr[joint])
        #: The joint's own name, where a sensor was named.
        self.joint = mjmodel.joint(joint).name
        self._name, self.model = name, model
        self._unit = model.period / (2.0 * np.pi)
        self._states: Any = None

    def read(self, fields: Mapping[str, Array], given: Mapping[str, Array], out: Array) -> None:
        angle = fields[self._field][:, self.at]
        if not self.model.terms and self.model.argument == "reference":
            # Many environments are read as fast as memory is: no pass more than is needed.
            if self._unit == 1.0:
                np.add(angle, self.model.error(angle), out=out)
            else:
                np.add(angle, self.model.error(angle * self._unit) / self._unit, out=out)
            return
        angle = angle * self._unit
        own = {"velocity": "qvel", "torque": "qfrc_actuator"}
        signals: dict[str, Array] = {}
        for name in self.model.uses_signals:
            if name in given:
                signals[name] = given[name]
            elif own.get(name) in fields:
                signals[name] = fields[own[name]][:, self._dof]
        for name in signals:
            if name == "velocity" or coupled_joint(name):
                signals[name] = signals[name] * self._unit
        missing = [name for name in self.model.signals if name not in {*signals, "direction"}]
        if missing:
            raise MissingSignalError(
                f"the model of joint {self._name!r} needs {missing[0]}, which MuJoCo does not "
                f"have: give read(data, {missing[0]}=...)"
            )
        known = 0 if self._states is None else len(self._states)
        if not known or (known != len(angle) and not self.model.follows_travel):
            self._states = _core.Alike(self.model._core_corrector(), len(angle))
        elif known != len(angle):
            raise ArgumentError(
                f"{known} environments were read before, and {len(angle)} now: "
                "their travel is not known; call reset() before"
            )
        np.divide(self._readings(angle, signals), self._unit, out=out)

    def _readings(self, angle: Array, signals: Mapping[str, Array]) -> Array:
        if self.model.argument == "reference":
            return np.asarray(angle + self._states.error(angle, **signals))
        # The error is one of the reading, which is looked for from the same past.
        past, reading = self._states, angle
        for _ in range(100):
            self._states = past.copy()
            found = np.asarray(angle + self._states.error(reading, **signals))
            moved = float(np.max(np.abs(found - reading), initial=0.0))
            reading = found
            # Radians within which the reading is found.
            if moved <= 1e-13 * self._unit:
                return reading
        self._states = past
        raise ArgumentError(
            f"the model of joint {self._name!r} gives no reading of its true angle: its error at "
            'the indicated angle is too steep; fit it with `argument="reference"`'
        )

    def reset(self, environments: ArrayLike | None) -> None:
        if environments is None:
            self._states = None
        elif self._states is not None:
            count, chosen = len(self._states), np.asarray(environments)
            try:
                numbers = np.arange(count)[chosen if chosen.size else []]
            except IndexError:
                raise ArgumentError(
                    f"environments must be a mask of the {count} that were read, or numbers below "
                    f"{count}, got {environments!r:.60}"
                ) from None
            self._states.reset(np.atleast_1d(numbers).tolist())


def _known(signals: Mapping[str, ArrayLike]) -> dict[str, Array]:
    known = ("velocity", "torque", "temperature", "current")
    for name in signals:
        if name not in known:
            raise ArgumentError(
                f"there is no signal `{name}=`; there are "
                f"{', '.join(known)}{did_you_mean(name, known)}"
            )
    return {name: np.asarray(value, np.float64) for name, value in signals.items()}


def _embedded_noise(mjmodel: MjModel) -> dict[str, float]:
    """Noise of encoders that the file holds, radians by joint."""
    found = {}
    for i in range(mjmodel.nnumeric):
        numeric = mjmodel.numeric(i)
        if numeric.name.startswith(NOISE_NAME):
            found[numeric.name[len(NOISE_NAME) :]] = float(numeric.data[0])
    return found


def _embedded(mjmodel: MjModel) -> dict[str, HarmonicModel]:
    """Models that the file holds, by joint."""
    import mujoco

    found = {}
    for i in range(mjmodel.ntext):
        name = mujoco.mj_id2name(mjmodel, mujoco.mjtObj.mjOBJ_TEXT, i) or ""
        if name.startswith(TEXT_NAME):
            start, size = int(mjmodel.text_adr[i]), int(mjmodel.text_size[i])
            raw = bytes(mjmodel.text_data[start : start + size]).rstrip(b"\0")
            found[name[len(TEXT_NAME) :]] = embedded_model(raw.decode("utf-8"), name)
    return found
