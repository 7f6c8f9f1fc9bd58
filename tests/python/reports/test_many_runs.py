"""Reports of very many runs: pages stay small, and pictures show them all."""

import numpy as np

import trueangle as ta
from plots.strokes import strokes
from trueangle.plots.curves import Points, thinned_points
from trueangle.plots.readingpictures import ANGLE, Cloud, Panel, PanelPicture
from trueangle.reports.figures import panel_figure

#: Bytes of a page at most.
LARGEST = 1_000_000


def test_few_runs_are_drawn_whole_and_many_in_part():
    totals = []
    for runs in (1, 12, 24, 48, 79):
        angle = np.linspace(0.0, 360.0, 2990 // min(runs, 12))
        clouds = tuple(Cloud(Points(f"{k}", angle, angle), k) for k in range(runs))
        picture = PanelPicture((Panel(ANGLE, "error / deg", clouds, (0.0, 360.0)),), "")
        (chart,) = panel_figure(picture)["charts"]
        drawn = strokes(chart)
        assert {one.run for one in drawn} == set(range(runs))
        totals.append(sum(len(one.points) for one in drawn))
    assert totals[:2] == [2990, 12 * 249]
    assert totals[1:] == sorted(totals[1:], reverse=True)
    assert totals[-1] > 400


def test_runs_that_are_alike_are_not_drawn_at_the_same_places():
    angle = np.arange(0.0, 360.0, 0.36)
    places = [thinned_points(Points("", angle, angle), 6, number).x for number in range(79)]
    assert all(5 <= x.size <= 6 for x in places)
    drawn = np.sort(np.concatenate(places))
    # Evenly spread: no gap as wide as a hundredth of a turn.
    assert np.diff(np.concatenate([drawn, [drawn[0] + 360.0]])).max() < 3.6


def test_a_page_of_eighty_runs_is_small(tmp_path):
    seed = 79
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    angle = np.arange(0.0, 360.0, 0.9)
    runs = []
    for k in range(80):
        phase = np.radians(angle + rng.uniform(0.0, 0.5))
        error = 0.4 * np.sin(phase) + 0.1 * np.cos(4.0 * phase) + rng.normal(0.0, 0.06, 400)
        time = angle / 300.0 + 1e-4 * rng.random(400)
        runs.append(ta.CalibrationRun(angle, angle + error, 360.0, time, label=f"run {k}"))
    ta.report(runs, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size < LARGEST
