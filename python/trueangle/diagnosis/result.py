"""The `Diagnosis`: what was found, what is unexplained, what could not be detected."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..support.display_units import ErrorsIn
from ..support.plainresult import result_picture
from .diagnosisdata import DiagnosisData
from .summary import diagnosis_summary

if TYPE_CHECKING:
    from matplotlib.axes import Axes


class Diagnosis(DiagnosisData):
    """What `trueangle.diagnose` found.

    Attributes
    ----------
    discrepancy : Discrepancy
        Measured minus simulated before anything is added.
    structure : dict of str to float
        Share of its variance that each cause would explain alone, largest first; shares
        overlap, and a flexible cause explains much that is not its own.
    noise : float
        Scatter of one reading, arcsec: from repeats where there are any, else what the
        findings leave.
    findings : list of Finding
        In the order found; empty where the simulation is enough.
    not_identifiable : list of Blindness
        What this data cannot show, and the measurement that would.
    extended : Simulation
        The simulation with every finding.
    gain : dict
        rms, peak-to-peak and max abs in arcsec, before and after all findings.
    readings, readings_used : int
    correlation : float
        Of the noise of neighbouring readings.
    unexplained : Unexplained or None
        The residual beyond the noise after all findings, by tests that need no name.
    unexplained_before : Unexplained or None
        The same tests before anything was added to the simulation.
    beliefs : list of Belief
        Verdicts on what the simulation already claims.
    data_faults : list of DataFault
        As `trueangle.check` reports them.
    notes : list of str
        What else must be known about the account.
    complete : bool
        False where it was ended early: by the time given, or by Ctrl-C.
    simulated : MeasuredMinusSimulated or None
        The log of another simulator that the simulation adds to.
    runs : list of CalibrationRun
        The readings, as given.
    factors : list of Factor
        What measured minus simulated follows, strongest first, whether it has a name or not.
    torque : TorqueAccount or None
        What the drive's torque lacks, where the readings and the simulator's log have one.
    """

    def plot(self, ax: Axes | None = None) -> Axes:
        """Gain of every finding with its interval (needs ``trueangle[plot]``).

        `trueangle.plots.factors` shows what the error follows, and
        `trueangle.plots.measured_and_simulated` and `trueangle.plots.error_left` the readings
        themselves.
        """
        axes: Axes = result_picture(self, ax)
        return axes

    def summary(self, errors_in: ErrorsIn = "auto", *, verbose: bool = False) -> str:
        """A readable account (`trueangle.diagnosis.summary.diagnosis_summary`).

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        verbose : bool
            Also report in full the causes not in question that these readings cannot show.
        """
        return diagnosis_summary(self, errors_in, verbose)
