"""The simulation file, read into a simulation."""

from __future__ import annotations

from pathlib import Path

from ..support.argumentkinds import told_kinds
from .simulation import Simulation
from .simulationtext import decoded_simulation, guarded_build


@told_kinds
def load_simulation(path: str | Path) -> Simulation:
    """Read a simulation file.

    Parameters
    ----------
    path : str or Path
        TOML with ``[joint]``, ``[[harmonic]]``, ``[[effect]]``, ``[noise]``, ``[[run]]``,
        each optional; keys are the parameters of `Joint`, `Harmonic`, the effects and
        `RunDesign`. With a ``gear_ratio`` the ``fixed_member`` is the circular spline and
        the encoder on the motor where the file does not state otherwise.

    Returns
    -------
    Simulation

    Raises
    ------
    FileError
        The file is missing, no TOML, or a key is unknown or out of range: the message
        names the table and the key.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "joint.toml"
    >>> _ = path.write_text("[joint]" + chr(10) + "gear_ratio = 50.0")
    >>> load_simulation(path).joint.gear_ratio
    50.0
    """
    found = decoded_simulation(path)
    return guarded_build(path, "simulation", lambda: Simulation(*found))
