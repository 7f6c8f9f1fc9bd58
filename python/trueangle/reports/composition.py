"""A report: its content, figures and page, written as HTML or PDF."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sized
from dataclasses import dataclass
from os import PathLike
from typing import TYPE_CHECKING, Any, ClassVar, TypeAlias, Unpack, overload

from ..errors import ArgumentError
from ..model.model import HarmonicModel
from ..runs.checks.check import data_faults
from ..runs.checks.record import records_of
from ..runs.files import runs_of
from ..runs.run import CalibrationRun
from ..runs.source import ReadingOptions
from ..runs.writing import provenance
from ..support.argumentkinds import of_type, told_kinds
from ..support.blas import one_blas_thread
from ..support.deadline import current_deadline
from ..support.display_units import ErrorsIn
from ..support.files import CERTIFICATE, PDF, REPORT, FileKind, check_output
from .diagnosed import diagnosis_content, unknown_content
from .figures import error_scale, figures_of_diagnosis, figures_of_runs, line_names
from .measured import measured_content
from .modelled import (
    extended_correction,
    fit_or_reason,
    gain_content,
    gain_or_reason,
    given_model,
    known_gear,
    known_joint,
    model_content,
    order_content,
)
from .page import Page, print_pdf, rendered_report

if TYPE_CHECKING:
    from ..certificate import Certificate, Identity
    from ..simulation import Simulation

#: Orders as `trueangle.fit` takes them.
Orders: TypeAlias = Iterable[float] | Mapping[str, Iterable[float]] | str | None

FORMAT, VERSION = "trueangle-report", 1

#: Steps of the work, for its progress.
_STAGES = 4


@dataclass(frozen=True, eq=False)
class Report(Page):
    """A report on calibration runs.

    Attributes
    ----------
    title : str
    content : dict
        Every number of the page, plain values: what the page carries as JSON.
    figures : dict of str to dict
        Figures by name: an ``alt`` text, their ``charts`` (`trueangle.plots`) and how these are
        arranged.
    """

    title: str
    content: dict[str, Any]
    figures: dict[str, dict[str, Any]]

    _kind: ClassVar[FileKind] = REPORT

    def _written(self) -> str:
        return rendered_report(self.content, self.figures)

    @property
    def _hashes(self) -> list[str]:
        return [entry["sha256"] for entry in self.content["provenance"]["inputs"]]

    def save(self, path: str | PathLike[str]) -> None:
        """Write the page, complete or not at all; a name that ends with ``.pdf``, as PDF.

        Raises
        ------
        FileError
            An ending of another format, a place that no file is written to, a file that
            the runs were read from.
        """
        if str(path).lower().endswith(PDF.endings):
            self.save_pdf(path)
        else:
            super().save(path)

    def save_pdf(self, path: str | PathLike[str], browser: str | None = None) -> None:
        """Print the page to a PDF by an installed browser (Chromium, Chrome, Edge).

        Raises
        ------
        ArgumentError
            No such browser is installed, or it failed.
        """
        check_output(path, PDF, hashes=self._hashes)
        print_pdf(self.html, path, browser)


@overload
def report(
    runs: Any,
    path: str | PathLike[str] | None = None,
    *,
    simulation: Simulation | None = None,
    orders: Orders = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    title: str | None = None,
    certificate: None = None,
    positions: None = None,
    model: HarmonicModel | str | PathLike[str] | None = None,
    errors_in: ErrorsIn = "auto",
    **reading: Unpack[ReadingOptions],
) -> Report: ...


@overload
def report(
    runs: Any,
    path: str | PathLike[str] | None = None,
    *,
    simulation: Simulation | None = None,
    orders: Orders = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    title: None = None,
    certificate: Identity | str | PathLike[str],
    positions: int | None = None,
    errors_in: ErrorsIn = "auto",
    **reading: Unpack[ReadingOptions],
) -> Certificate: ...


@one_blas_thread()
@told_kinds
def report(
    runs: Any,
    path: str | PathLike[str] | None = None,
    *,
    simulation: Simulation | None = None,
    orders: Orders = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    title: str | None = None,
    certificate: Identity | str | PathLike[str] | None = None,
    positions: int | None = None,
    model: HarmonicModel | str | PathLike[str] | None = None,
    errors_in: ErrorsIn = "auto",
    **reading: Unpack[ReadingOptions],
) -> Report | Certificate:
    """Fit, select orders, hold out, diagnose and put it all on one page; or certify.

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        As `trueangle.fit` takes them.
    path : path, optional
        Where to write the page (HTML).
    simulation : Simulation, optional
        The assumed model of the joint: the report then states what it gets wrong and why.
        Gives the gear ratio too.
    orders : optional
        As for `trueangle.fit`; by default selected by evidence.
    gear_ratio, fixed_member, shafts
        As for `trueangle.fit`; a simulation states them itself.
    title : str, optional
    certificate : Identity or path, optional
        An identity file: what is made, returned and written to ``path`` (PDF) is then a
        calibration certificate, see `trueangle.certificate.certify`.
    positions : int, optional
        Nominal positions to a turn of a certificate.
    model : HarmonicModel or path, optional
        A model that is there already, such as one calibrated without a reference: the
        report states in its first lines how it was made, what it is blind to, and what it
        leaves of these runs. A certificate states the values as it leaves them next to those
        as found.
    errors_in : str or float
        Unit of every error on the page or in the certificate: ``"arcsec"``, ``"deg"``,
        ``"mrad"``, ``"count"``, or the counts of a turn; ``"auto"`` is arcsec, or degrees
        where they are that large. The content stays in arcsec.
    **reading
        ``signals``, ``period``, ``by`` ... of files and tables, as in `trueangle.read_runs`.

    Returns
    -------
    Report or Certificate

    Raises
    ------
    MissingExtraError
        jinja2 or matplotlib is not installed (``pip install trueangle[report]``).

    Examples
    --------
    >>> theta = np.arange(0.0, 360.0, 5.0)
    >>> error = 0.1 * np.sin(np.radians(theta))
    >>> made = report(CalibrationRun(theta, theta + error, period=360.0), orders=[1])
    >>> round(made.content["model"]["coefficients"][0]["amplitude_arcsec"], 6)
    360.0
    """
    found = runs_of(runs, reading)
    if isinstance(orders, Sized) and not any(True for _ in orders):  # a range may have no length
        raise ArgumentError("orders is empty: name one at least, or leave it out for those found")
    if simulation is not None:
        from ..simulation.simulation import SIMULATION, Simulation

        of_type("simulation", simulation, Simulation, SIMULATION)
    if path is not None:  # before the work
        kind = REPORT if certificate is None else CERTIFICATE
        check_output(path, kind, hashes=[run.source.sha256 for run in found if run.source])
    if simulation is not None and (gear_ratio is not None or shafts):
        what = "shafts" if shafts else "gear_ratio"
        raise ArgumentError(f"give either `{what}=` or a simulation, which states it")
    joint = known_joint(simulation, gear_ratio, fixed_member, shafts)
    if certificate is not None:
        if title is not None:
            raise ArgumentError("a certificate takes its title from the identity file")
        from ..certificate import certify

        certified = certify(
            found,
            certificate,
            orders=orders,
            positions=positions,
            model=model,
            errors_in=errors_in,
            **known_gear(joint),
        )
        if path is not None:
            certified.save(path)
        return certified
    if positions is not None:
        raise ArgumentError("positions are those of a certificate: give certificate too")
    sizes = measured_content(found)
    scale = error_scale(errors_in, sizes["error"]["rms_arcsec"], found)
    at = current_deadline()
    at.at("fitting", 0, _STAGES)
    fit, selection, why_not = fit_or_reason(found, orders, joint)
    at.at("holding runs out", 1, _STAGES)
    held, why_no_gain = gain_or_reason(fit)
    at.at("diagnosing", 2, _STAGES)
    name = line_names(joint)
    diagnosis = None
    if simulation is not None:
        from ..diagnosis import diagnose

        diagnosis = diagnose(found, simulation)
    heading = title or _title(found)
    content: dict[str, Any] = {
        "format": FORMAT,
        "version": VERSION,
        "title": heading,
        "errors_in": scale.to_dict(),
        "measured": sizes,
        "data_faults": [fault.to_dict() for fault in data_faults(records_of(found))],
        "selection": None if selection is None else order_content(selection, name),
        "model": None if fit is None else model_content(fit, name),
        "why_no_model": why_not,
        "given_model": None if model is None else given_model(model, found),
        "gain": None if held is None else gain_content(held),
        "why_no_gain": why_no_gain,
        "diagnosis": None,
        "extended": None,
        "provenance": provenance(found, None if simulation is None else simulation.source),
    }
    at.at("drawing", 3, _STAGES)
    drawn = figures_of_runs(found, fit, selection, held, name, scale)
    if simulation is not None and diagnosis is not None:
        content["diagnosis"] = diagnosis_content(diagnosis)
        content["extended"] = extended_correction(fit, diagnosis, found, simulation)
        drawn |= figures_of_diagnosis(diagnosis, found, simulation, scale)
    content["unknowns"] = unknown_content(found, selection, content["diagnosis"])
    made = Report(heading, content, drawn)
    if path is not None:
        made.save(path)
    return made


def _title(runs: list[CalibrationRun]) -> str:
    files = sorted({run.source.file for run in runs if run.source is not None})
    return f"Angle error of {', '.join(files)}" if files else "Angle error of a joint"
