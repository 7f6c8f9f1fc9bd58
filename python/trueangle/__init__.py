"""trueangle: measure, explain and correct the angle error of rotary encoders and robot joints."""

TYPE_CHECKING = False  # nothing is imported, and no core: Ctrl-C in here has a traceback
if TYPE_CHECKING:
    from typing import Any

    from . import errors as errors
    from . import plots as plots
    from ._core import __version__ as __version__
    from .diagnosis import Diagnosis as Diagnosis
    from .diagnosis.diagnose import diagnose as diagnose
    from .errors import TrueAngleError as TrueAngleError
    from .estimation.moments import Moments as Moments
    from .export import export_model as export_model
    from .export import import_model as import_model
    from .export.comparison import compare as compare
    from .fitting.fit import fit as fit
    from .fitting.orders.select import OrderSelection as OrderSelection
    from .fitting.orders.select import select_orders as select_orders
    from .fitting.result import FitResult as FitResult
    from .fleets import Fleet as Fleet
    from .fleets.file import load_fleet as load_fleet
    from .fleets.fleet import fleet as fleet
    from .joint.shafts import Shaft as Shaft
    from .logs.batch import correct_logs as correct_logs
    from .logs.fitting import fit_logs as fit_logs
    from .logs.frames import correct as correct
    from .model import terms as terms
    from .model.file import load_model as load_model
    from .model.model import HarmonicModel as HarmonicModel
    from .model.monitor import Monitor as Monitor
    from .model.robot import Robot as Robot
    from .model.robot import load_robot as load_robot
    from .model.terms import Backlash as Backlash
    from .model.terms import FilterLag as FilterLag
    from .model.terms import Latency as Latency
    from .model.terms import LoadDependentGearError as LoadDependentGearError
    from .model.terms import LocalDefect as LocalDefect
    from .model.terms import PreslidingHysteresis as PreslidingHysteresis
    from .model.terms import StiffeningCompliance as StiffeningCompliance
    from .model.terms import ThermalDrift as ThermalDrift
    from .model.terms import TorsionalCompliance as TorsionalCompliance
    from .planning.arc import plan_arc as plan_arc
    from .planning.plan import plan_mounts as plan_mounts
    from .rehearsal import Rehearsal as Rehearsal
    from .rehearsal.after import plan_after as plan_after
    from .rehearsal.rehearse import rehearse as rehearse
    from .reports import report as report
    from .runs.checks.check import check as check
    from .runs.files import read_runs as read_runs
    from .runs.joining.join import join as join
    from .runs.rawchannels import Channels as Channels
    from .runs.run import CalibrationRun as CalibrationRun
    from .runs.writing import write_runs as write_runs
    from .selfcalibration.calibrate import selfcal as selfcal
    from .selfcalibration.channelcauses import diagnose_channels as diagnose_channels
    from .selfcalibration.channelcheck import check_channels as check_channels
    from .selfcalibration.result import SelfCalibration as SelfCalibration
    from .simulation import Simulation as Simulation
    from .simulation import load_simulation as load_simulation
    from .simulation import simulate as simulate
    from .support.angles import wrap as wrap

#: Public names by the module that defines them; it is imported at first use.
_NAMES = {
    "_core": "__version__",
    "diagnosis": "diagnose Diagnosis",
    "errors": "TrueAngleError",
    "estimation.moments": "Moments",
    "export": "export_model import_model",
    "export.comparison": "compare",
    "fitting.fit": "fit",
    "fitting.orders.result": "OrderSelection",
    "fitting.orders.select": "select_orders",
    "fitting.result": "FitResult",
    "fleets": "Fleet fleet load_fleet",
    "joint.shafts": "Shaft",
    "logs.batch": "correct_logs",
    "logs.fitting": "fit_logs",
    "logs.frames": "correct",
    "model.file": "load_model",
    "model.model": "HarmonicModel",
    "model.monitor": "Monitor",
    "model.robot": "load_robot Robot",
    "model.terms": "Backlash FilterLag Latency LoadDependentGearError "
    "LocalDefect PreslidingHysteresis StiffeningCompliance ThermalDrift TorsionalCompliance",
    "planning": "plan_arc plan_mounts",
    "rehearsal": "plan_after Rehearsal rehearse",
    "reports": "report",
    "runs.checks.check": "check",
    "runs.files": "read_runs",
    "runs.joining": "join",
    "runs.rawchannels": "Channels",
    "runs.run": "CalibrationRun",
    "runs.writing": "write_runs",
    "selfcalibration.calibrate": "selfcal",
    "selfcalibration.channelcauses": "diagnose_channels",
    "selfcalibration.channelcheck": "check_channels",
    "selfcalibration.result": "SelfCalibration",
    "simulation": "load_simulation simulate Simulation",
    "support.angles": "wrap",
}
_PUBLIC = {name: module for module, names in _NAMES.items() for name in names.split()}

#: Modules that are reached as attributes, likewise imported at first use.
_MODULES = {"errors": "errors", "plots": "plots", "terms": "model.terms"}

__all__ = sorted([*_PUBLIC, *_MODULES])


def __getattr__(name: str) -> "Any":
    import importlib

    if name in _MODULES:
        return importlib.import_module(f".{_MODULES[name]}", __name__)
    module = _PUBLIC.get(name)
    if module is None:
        raise AttributeError(f"module 'trueangle' has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{module}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(__all__)  # what completion shows
