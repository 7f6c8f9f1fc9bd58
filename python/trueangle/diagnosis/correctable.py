"""What a diagnosis confirmed, as the model of a correction or of a simulator's sensor."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from ..errors import ArgumentError, NoModelError
from ..model.model import HarmonicModel
from ..runs.checks.record import records_of
from ..runs.checks.result import extent_of
from ..simulation.simulation import Simulation
from ..support.angles import ARCSEC_PER_TURN
from ..support.argumentkinds import of_type
from ..support.plainresult import PlainResult
from .correction import extend_model

if TYPE_CHECKING:
    from ..fitting.argument import AnyArgument
    from ..runs.joining import MeasuredMinusSimulated
    from ..runs.run import CalibrationRun


#: What to do where the runs are planned.
PLANNED = "measure the planned runs (`diagnosis.plan()`)"


def measure_more(runs: Sequence[CalibrationRun] = ()) -> str:
    """What to do where nothing else is known, with the motion that these runs lack."""
    lacks = []
    if runs:
        extent = extent_of(records_of(runs))
        lacks += ["in both directions"] * (len(extent.directions) < 2)
        lacks += ["at two speeds"] * (len(extent.speeds) < 2)
    motion = f" {' and '.join(lacks)}" if lacks else ""
    return f"measure more runs{motion}, then diagnose again"


class Correctable(PlainResult):
    """A diagnosis that a model can be made of."""

    if TYPE_CHECKING:
        # What the diagnosis holds.
        @property
        def next_steps(self) -> list[str]:
            """What to do next."""

        extended: Simulation
        noise: float
        runs: Sequence[CalibrationRun]
        simulated: MeasuredMinusSimulated | None

    def correction(
        self,
        model: HarmonicModel | None = None,
        runs: CalibrationRun | Iterable[CalibrationRun] | None = None,
        *,
        argument: AnyArgument = "auto",
    ) -> HarmonicModel:
        """The correction model of what was confirmed, fitted to the runs.

        Parameters
        ----------
        model : HarmonicModel, optional
            One to extend. Without it the lines that the simulation assumes, as measured, and
            those of the findings are its orders, and other findings its terms.
        runs : CalibrationRun or iterable of them, optional
            In place of those that were diagnosed.
        argument : {"auto", "reference", "indicated"}
            As of `trueangle.fit`; by itself that of the model.

        Returns
        -------
        HarmonicModel
            See `trueangle.diagnosis.correction.extend_model`.

        Raises
        ------
        NoModelError
            No confirmed cause can be corrected; states why and what to measure.
        NotInvertibleError
            The error is too steep for a model of the true angle.
        KindError
            What is given as model is none.
        ArgumentError
            Nothing to extend, and the diagnosis is based on the log of another simulator.

        Examples
        --------
        >>> from trueangle import diagnose, simulate
        >>> from trueangle.simulation import Backlash, RunDesign, Simulation
        >>> sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(reversals=(0.5,)),
        ...                                          RunDesign(reversals=(0.5,), speed_deg_s=30)))
        >>> model = diagnose(simulate(sim.with_effects([Backlash(36.0)])), sim).correction()
        >>> round(model.terms[0].half_width, 3)
        0.01
        """
        if model is None:
            self._check_correctable()
        else:
            of_type("model", model, HarmonicModel, "a trueangle.HarmonicModel, or omitted")
        given = self.runs if runs is None else runs
        return extend_model(model, given, self.extended, argument)

    def sensor(self, *, without_any: bool = False) -> HarmonicModel:
        """What was confirmed as the model of a sensor: what a simulator's encoder lacks.

        Parameters
        ----------
        without_any : bool
            Give an empty model where nothing was confirmed.

        Returns
        -------
        HarmonicModel
            Its error is in addition to the log's, where the diagnosis had one; else it is
            the whole error of the joint.

        Raises
        ------
        NoModelError
            Nothing was confirmed that a sensor can have.
        NotInvertibleError
            The error is too steep for a model of the true angle.
        """
        if without_any and not self._is_correctable:
            return HarmonicModel(())
        self._check_confirmed()
        runs = self.runs if self.simulated is None else self.simulated.runs
        return extend_model(None, runs, self.extended)

    def sensor_noise(self) -> float:
        """Standard deviation of the noise that a simulator's encoder lacks, radians.

        The noise of one reading, without what the log's own encoder has: that is in measured
        minus simulated, and stays in the simulator.
        """
        own = 0.0 if self.simulated is None else self.simulated.noise_arcsec
        lacking = math.sqrt(max(self.noise**2 - 2.0 * own**2, 0.0))
        return lacking * 2.0 * math.pi / ARCSEC_PER_TURN

    def _check_correctable(self) -> None:
        """Raise where there is nothing that a model could be made of."""
        if self.simulated is not None:
            raise ArgumentError(
                "no correction model can hold what is known as a log only: give the model to extend"
            )
        self._check_confirmed()

    @property
    def _is_correctable(self) -> bool:
        """Something was confirmed that a model can hold."""
        effects = self.extended.effects
        return bool(self.extended.harmonics) or any(not e.not_at_run_time for e in effects)

    def _check_confirmed(self) -> None:
        """Raise where nothing was confirmed that a model can hold."""
        if self._is_correctable:
            return
        steps = "; ".join(self.next_steps or [measure_more()])
        raise NoModelError(
            f"no correction can be given: no confirmed cause can be corrected; {steps}"
        )
