"""What the torque of a simulated drive lacks: ripple, dry friction, damping; in words too."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from ..estimation.quantity import Parameters, Quantity
from ..support.plainresult import ShownResult, plain_fields

#: What parameters are called, and their units.
_TOLD: Final = {
    "torque_Nm": ("", " Nm"),
    "phase_deg": ("at ", " deg"),
    "Nm_s_per_rad": ("", " Nm s/rad"),
}


@dataclass(frozen=True)
class TorqueFinding(ShownResult):
    """What the drive's torque holds beyond the simulator's.

    Attributes
    ----------
    effect : str
        ``torque_ripple`` (order, torque_Nm, phase_deg of what acts on the joint, Nm sin(order
        angle + phase)), ``dry_friction`` (torque_Nm), ``damping`` (Nm_s_per_rad), or another.
    parameters : dict of str to Quantity
    status, reason : str
        As of a `Finding`.
    """

    effect: str
    parameters: Parameters
    status: str
    reason: str = ""

    @property
    def confirmed(self) -> bool:
        """Fit to be written into a simulator."""
        return self.status == "confirmed"

    def summary(self) -> str:
        """One line."""
        parts = []
        for name, entry in self.parameters.items():
            values = entry.value if isinstance(entry.value, list) else [entry.value]
            text = ", ".join(f"{v:.4g}" if isinstance(v, float | int) else str(v) for v in values)
            std = f" +- {entry.std:.2g}" if isinstance(entry.std, float) else ""
            called, unit = _TOLD.get(name, (f"{name.replace('_', ' ')} ", ""))
            parts.append(f"{called}{text}{std}{unit}")
        doubt = "" if self.confirmed else f" (NOT CONFIRMED: {self.reason})"
        return f"{self.effect.replace('_', ' ')}: {', '.join(parts)}{doubt}"

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return plain_fields(self, "effect status status_reason=reason parameters")


@dataclass(frozen=True)
class TorqueAccount(ShownResult):
    """What the torque of a simulated drive lacks.

    Attributes
    ----------
    rms, noise : float
        Measured minus simulated, and the noise of one reading in it, Nm.
    unexplained : bool
        More is there than the findings and noise.
    findings : tuple of TorqueFinding
    complete : bool
        False where the time was up.
    """

    rms: float
    noise: float
    unexplained: bool
    findings: tuple[TorqueFinding, ...]
    complete: bool = True

    @property
    def ripple(self) -> str:
        """Confirmed waves of whole orders as ``ORDER:Nm:DEG,...``: option ``ripple`` of MuJoCo."""
        waves = []
        for finding in self.findings:
            if finding.confirmed and finding.effect == "torque_ripple":
                order, torque, phase = (
                    number_of_quantity(finding.parameters[name])
                    for name in ("order", "torque_Nm", "phase_deg")
                )
                if order >= 1.0 and order.is_integer():
                    waves.append(f"{order:.0f}:{torque!r}:{phase!r}")
        return ",".join(waves)

    @property
    def advice(self) -> str:
        """What the joint's own attributes in MuJoCo lack; empty where they lack nothing."""
        parts = []
        for effect, parameter, attribute in (
            ("dry_friction", "torque_Nm", "frictionloss"),
            ("damping", "Nm_s_per_rad", "damping"),
        ):
            for finding in self.findings:
                if finding.confirmed and finding.effect == effect:
                    value = number_of_quantity(finding.parameters[parameter])
                    parts.append(f"{value:+.4g} to its {attribute}")
        return f"add {' and '.join(parts)}" if parts else ""

    def lines(self) -> Iterator[str]:
        """The account, a sentence or a finding each."""
        yield (
            f"Torque of the drive, measured minus simulated: rms {self.rms:.3g} Nm, including "
            f"{self.noise:.3g} Nm noise of one reading."
        )
        for finding in self.findings:
            yield f"- {finding.summary()}"
        if not self.findings and not self.unexplained:
            yield "- nothing is in it beyond the simulator's"
        if self.unexplained:
            yield "- NOT UNDERSTOOD: there is more in it than noise"
        if self.advice:
            yield f"- of MuJoCo's joint: {self.advice}"
        if not self.complete:
            yield "- INCOMPLETE: the time was up"

    def summary(self) -> str:
        """The account as readable text."""
        return "\n".join(self.lines())

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return plain_fields(self, "rms_Nm=rms noise_Nm=noise unexplained findings complete")


def number_of_quantity(given: Quantity) -> float:
    """A quantity that is one number."""
    assert isinstance(given.value, float | int)
    return float(given.value)
