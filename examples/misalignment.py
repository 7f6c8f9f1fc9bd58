"""Orders against a known misalignment of magnet and sensor (RM44, measured).

``python examples/misalignment.py rm44_misalignment.csv``: one row per stage
offset, amplitude of orders 1, 2 and 4. The magnet side (``xd``) moves order 1, the
sensor side (``xs``) order 2, the gap (``zs``) order 4.
"""

import sys

import trueangle as ta

ORDERS = (1, 2, 4)


def amplitudes(run: ta.CalibrationRun) -> list[tuple[float, float, bool]]:
    """Amplitude, standard error (deg) and whether the order is retained in this run."""
    chosen = ta.select_orders(run, candidates=range(1, 9))
    rows = [chosen.row(order) for order in ORDERS]
    return [(row.amplitude, row.standard_error, row.retained) for row in rows]


def table(path: str) -> str:
    """Amplitude against stage offset, axis by axis."""
    groups: dict[str, list[tuple[float, ta.CalibrationRun]]] = {}
    for run in ta.read_runs(path):
        axis = str(run.columns["stage_axis"][0])
        groups.setdefault(axis, []).append((float(run.columns["stage_offset_um"][0]), run))
    lines = []
    for axis, runs in groups.items():
        lines.append(f"axis {axis}   offset/um   " + "   ".join(f"order {k}, deg" for k in ORDERS))
        for offset, run in sorted(runs, key=lambda pair: pair[0]):
            cells = [f"{a:7.4f}{' ' if kept else '?'}    " for a, _, kept in amplitudes(run)]
            lines.append(f"          {offset:9.0f}   " + "   ".join(cells))
    lines.append("? not retained in that run by itself")
    return "\n".join(lines)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python examples/misalignment.py rm44_misalignment.csv")
    print(table(sys.argv[1]))
