"""Figures and measured tables of the documentation, made anew by every build."""

from __future__ import annotations

import os
import platform
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

from causes import causes_page
from channelpicture import channel_picture
from roomfiles import room_files_page
from simulatorpictures import simulator_pictures

import trueangle as ta
from trueangle import plots
from trueangle.certificate import certify
from trueangle.certificate.typesetting import certificate_pictures
from trueangle.cli import COMMANDS, build_parser
from trueangle.diagnosis import diagnose
from trueangle.effects import Backlash, Latency
from trueangle.planning import plan_mounts
from trueangle.reports.demo import demo_simulation

__all__ = ["everything"]

ROOT = Path(__file__).resolve().parents[1]

#: Scripts of the gallery: what they show, and how they are called for it.
EXAMPLES = {
    "control_loop.py": (
        "A loop with a wrong and with a corrected encoder",
        "--seconds 1.5",
    ),
    "spin_down.py": ("From a coasting shaft to a corrected loop, without a reference", ""),
    "long_log.py": ("A log corrected in blocks", "--rows 2e5"),
}

#: Size of the batches that are timed.
SAMPLES = 200_000


def everything(folder: Path) -> None:
    """Write all figures and tables into ``folder``."""
    folder.mkdir(exist_ok=True)
    figures(folder)
    simulator_pictures(folder)
    (folder / "performance.md").write_text(performance(), encoding="utf-8")
    (folder / "scaling.md").write_text(scaling(folder / "scaling.svg"), encoding="utf-8")
    (folder / "gallery.md").write_text(gallery(), encoding="utf-8")
    (folder / "causes.md").write_text(causes_page(), encoding="utf-8")
    (folder / "rooms.md").write_text(room_files_page(), encoding="utf-8")
    (folder / "commands.md").write_text(commands(), encoding="utf-8")
    pages(folder / "pages")


def figures(folder: Path) -> None:
    """One picture for each part of the method, and the tutorial's own of its own joint."""
    sim = demo_simulation()
    # Two causes: a chart of one bar says nothing.
    runs = ta.simulate(replace(sim, effects=(Backlash(8.0), Latency(4e-4))), seed=4)
    fit = ta.fit(runs[:6], gear_ratio=100.0)
    taught = tutorial_runs()
    learnt = ta.fit(taught[:2], orders=[1, 100], gear_ratio=100)
    diagnosis = diagnose(runs, sim)
    plan = plan_mounts(100, positions=36, mounts=2)
    drawn = {
        "errors": plots.error_curves(fit),
        "spectrum": plots.amplitude_spectrum(fit),
        "phases": plots.phases_over_runs(learnt),
        "held-out": plots.before_after(learnt.model, taught[2:]),
        "direction": plots.residuals(fit, "direction"),
        "simulated": plots.measured_and_simulated(runs, sim),
        "left": plots.error_left(diagnosis),
        "gains": plots.gains(diagnosis),
        "positions": plots.plan_positions(plan),
        "factors": plots.plan_factors(plan),
        "folded": folded(),
    }
    for name, ax in drawn.items():
        ax.figure.savefig(folder / f"{name}.svg")
        mpl.pyplot.close(ax.figure)
    for number, draw in paper_figures().items():
        drawn_figure = draw()
        drawn_figure.savefig(folder / f"paper{number}.svg")
        mpl.pyplot.close(drawn_figure)
    channels = channel_picture()
    channels.savefig(folder / "channels.svg")
    mpl.pyplot.close(channels)
    for name, shape in {"story": (1, 3), "story-narrow": (3, 1)}.items():
        told = story(*shape)
        told.savefig(folder / f"{name}.svg")
        mpl.pyplot.close(told)


def tutorial_runs() -> list[ta.CalibrationRun]:
    """The runs of the joint that the tutorial describes."""
    text = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
    described = re.search(r"```toml\n(.*?)```", text, re.S)
    assert described
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "joint.toml")
        file.write_text(described[1], encoding="utf-8")
        return ta.simulate(ta.load_simulation(file), seed=0)


def story(rows: int, columns: int) -> mpl.figure.Figure:
    """The error of a joint, what a correction from 36 positions leaves, and what it hid."""
    joint = replace(demo_simulation(), sigma_arcsec=1.0)

    def measure(angles, seed):
        rng = np.random.default_rng(seed)
        error = joint.pattern.value(np.radians(angles)) + rng.normal(0.0, 1.0, angles.size)
        return ta.CalibrationRun(angles, angles + error / 3600.0, period=360.0)

    positions = np.arange(0.0, 360.0, 10.0)
    everywhere = np.linspace(0.0, 360.0, 7201)[:-1]
    once = ta.fit([measure(positions, k) for k in range(4)], range(1, 18), loss="linear").model
    mounts = plan_mounts(100, positions=36, mounts=2).mount_offsets_deg
    planned = ta.fit([measure(positions + mounts[k % 2], k) for k in range(4)], gear_ratio=100.0)

    def left(model, angles):
        return 3600.0 * ta.wrap(model.error(angles) - model.constant, 360.0)

    truth = joint.pattern.value(np.radians(everywhere))
    size = (10.0, 3.0) if rows == 1 else (4.2, 7.4)
    figure, axes = mpl.pyplot.subplots(
        rows, columns, figsize=size, sharex=True, sharey=True, layout="constrained"
    )
    axes[0].plot(everywhere, truth, color="#B8C4CE", linewidth=0.4)
    axes[0].plot(positions, joint.pattern.value(np.radians(positions)), ".", color="#B06A00")
    axes[0].set_title("1. Error of a joint,\nmeasured at 36 positions")
    rest = joint.pattern.value(np.radians(positions)) - left(once, positions)
    axes[1].plot(everywhere, truth - left(once, everywhere), color="#C04A00", linewidth=0.4)
    axes[1].plot(positions, rest, ".", color="#0072B2")
    between = (truth - left(once, everywhere)).std()
    axes[1].set_title(
        f"2. Corrected from these: {rest.std():.0f} arcsec\nat them, {between:.0f} between"
    )
    rest = truth - left(planned.model, everywhere)
    axes[2].plot(everywhere, rest, color="#0072B2", linewidth=1.2)
    axes[2].set_title(f"3. Measured at two planned mounts:\n{rest.std():.1f} arcsec everywhere")
    for ax in axes:
        ax.set_xticks([0, 90, 180, 270, 360])
        ax.title.set_fontsize("medium")
        ax.grid(True, color="#00000018")
    for ax in axes if rows == 1 else axes[-1:]:
        ax.set_xlabel("output angle / deg")
    for ax in axes[:1] if rows == 1 else axes:
        ax.set_ylabel("error / arcsec")
    return figure


def folded() -> mpl.axes.Axes:
    """Order 202 and order 14 at 36 positions: the same numbers."""
    _, ax = mpl.pyplot.subplots(figsize=(7.5, 3.2), layout="constrained")
    theta = np.linspace(0.0, 60.0, 4001)
    at = np.arange(0.0, 61.0, 10.0)
    # 202 = 6 * 36 - 14: at multiples of 10 degrees sin(202 x) = -sin(14 x).
    ax.plot(theta, np.sin(np.radians(202 * theta)), color="#E69F00", label="order 202")
    ax.plot(theta, -np.sin(np.radians(14 * theta)), color="#0072B2", label="order 14")
    ax.plot(at, np.sin(np.radians(202 * at)), "o", color="#000000", label="every 10 degrees")
    ax.set_xlabel("output angle / deg")
    ax.set_ylabel("error / amplitude")
    ax.set_ylim(-1.2, 1.6)
    ax.legend(loc="upper center", ncols=3, frameon=False)
    return ax


def pages(folder: Path) -> None:
    """What users get: the demonstration's report, and the certificate of the how-to."""
    folder.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "trueangle", "demo", "--report", str(folder / "report.html")]
    subprocess.run(command, capture_output=True, check=True)
    text = (ROOT / "docs" / "howto" / "certificate.md").read_text(encoding="utf-8")
    identity = re.search(r"```toml\n(.*?)```", text, re.S)
    assert identity
    with tempfile.TemporaryDirectory() as made:
        ta.write_runs(tutorial_runs(), Path(made, "joint.csv"))
        file = Path(made, "identity.toml")
        file.write_text(identity[1], encoding="utf-8")
        read = ta.read_runs(Path(made, "joint.csv"))
        content = certify(read, file, gear_ratio=100.0).content
    for number, page in enumerate(certificate_pictures(content), start=1):
        (folder / f"certificate{number}.png").write_bytes(page)


def performance() -> str:
    """The text that ``trueangle bench`` prints on the machine of this build."""
    command = [sys.executable, "-m", "trueangle", "bench", "--samples", str(SAMPLES)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    head = f"Nanoseconds per sample, measured by this build ({platform.machine()}):"
    return f"{head}\n\n```text\n{done.stdout}```\n"


def scaling(picture: Path) -> str:
    """The text of ``benches/scaling.py`` of this build, and its picture."""
    command = [sys.executable, str(ROOT / "benches" / "scaling.py"), "--plot", str(picture)]
    command += ["--largest", "1e6", "--rounds", "2"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return f"```text\n{done.stdout}```\n"


def commands() -> str:
    """What every command says of itself."""
    os.environ["COLUMNS"] = "92"  # the width that argparse wraps to
    parsers = build_parser().commands
    return "\n".join(
        f"## {name}\n\n```text\n{parsers[name].format_help()}```\n" for name in COMMANDS
    )


def paper_figures() -> dict[int, Callable[[], mpl.figure.Figure]]:
    """The paper's figures beside what they hide, as the example draws them."""
    sys.path.insert(0, str(ROOT / "examples" / "paper"))
    import figures

    return figures.FIGURES


def gallery() -> str:
    """Every example script with what it printed when this page was made."""
    parts = []
    for name, (what, arguments) in EXAMPLES.items():
        script = ROOT / "examples" / name
        command = [sys.executable, str(script), *arguments.split()]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        parts.append(
            f"## {what}\n\n```text\n$ python examples/{name} {arguments}\n{done.stdout}```\n\n"
            f":::{{dropdown}} examples/{name}\n```python\n{script.read_text('utf-8')}```\n:::\n"
        )
    return "\n".join(parts)
