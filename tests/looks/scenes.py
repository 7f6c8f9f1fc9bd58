"""Every command once, on small simulated data."""

from dataclasses import replace

from trueangle.cli import COMMANDS
from trueangle.effects import Backlash
from trueangle.reports.demo import demo_simulation
from trueangle.runs.writing import write_runs
from trueangle.simulation import Harmonic, RunDesign, Simulation, simulate

__all__ = ["furnish", "scenes"]

#: What is typed, in the folder that `furnish` fills; of a command that is not here, its help.
SCENES = {
    "check": ["check runs.csv"],
    "fit": ["fit runs.csv -o joint.json --gear-ratio 100"],
    "orders": ["orders runs.csv --gear-ratio 100"],
    "plot": ["plot runs.csv -o runs.png --gear-ratio 100", "plot joint.json -o joint.png"],
    "plan": [
        "plan --gear-ratio 100 --positions 36 --mounts 2",
        "plan --self spin-down --noise-arcsec 20 --std-arcsec 0.3 --start-speed 10 --rate 1000",
        "plan --arc 0:90 --orders 1-4 --readings 100",
    ],
    "simulate": ["simulate believed.toml -o simulated.csv"],
    "diagnose": [
        "diagnose runs.csv --simulation believed.toml",
        "diagnose runs.csv --gear-ratio 100 --verbose",
    ],
    "rehearse": ["rehearse believed.toml --causes backlash --seeds 2 --workers 1"],
    "report": ["report runs.csv --simulation believed.toml -o report.html"],
    "correct": ["correct runs.csv again.csv -m joint.json -o corrected"],
    "export": ["export joint.json --to csv --entries 720 -o table.csv"],
    "import": ["import table.csv --from csv -o read.json"],
    "compare": ["compare joint.json read.json"],
    "join": ["join runs.csv again.csv -o joined.csv"],
    "robot": ["robot --from-urdf arm.urdf -o robot.toml"],
    "fleet": ["fleet runs.csv again.csv --by run"],
    "watch": ["watch runs.csv -m joint.json"],
    "selfcal": ["selfcal coast.csv -o coast.json --loop open"],
    "demo": ["demo"],
    "bench": ["bench --samples 1000 --rounds 1"],
    "completion": [],  # a script for a shell, not for people
}

_ARM = (
    '<robot name="arm"><link name="a"/><link name="b"/><joint name="elbow" type="revolute">'
    '<parent link="a"/><child link="b"/></joint></robot>\n'
)


def scenes():
    """Lines to type for every command there is."""
    return {command: SCENES.get(command, [f"{command} --help"]) for command in COMMANDS}


def furnish(folder):
    """Runs of a geared joint with backlash, what is believed of it, and a shaft that coasts."""
    believed = demo_simulation()
    true = replace(believed, effects=(Backlash(half_width_arcsec=8.0),))
    write_runs(simulate(true, seed=5), folder / "runs.csv")
    write_runs(simulate(true, seed=6), folder / "again.csv")
    believed.save(folder / "believed.toml")
    coast = RunDesign(speed_deg_s=3600.0, speed_end_deg_s=720.0, turns=100.0, samples=20_000)
    coast = replace(coast, spacing="clock")
    lines = (Harmonic("output", 1, 300.0, 20.0), Harmonic("output", 2, 150.0, 60.0))
    rotor = Simulation(harmonics=lines, sigma_arcsec=20.0, runs=(coast,))
    write_runs(simulate(rotor, seed=7), folder / "coast.csv")
    (folder / "arm.urdf").write_text(_ARM)
