"""What a bench tells of times that are known: every number, unit and word of its lines."""

import json

import pytest

from trueangle.cli import main
from trueangle.cli.benchmarks import evaluation, fit, scaling
from trueangle.cli.benchmarks.evaluation import EvaluationRow
from trueangle.cli.benchmarks.fit import Case, FitRow
from trueangle.cli.benchmarks.interleaved import Timing
from trueangle.cli.benchmarks.scaling import MeasuredWork, WorkCost


@pytest.fixture
def asked(monkeypatch):
    """Every measurement gives rows of its own, and keeps what it was asked."""
    found = {}

    def give(module, name, rows):
        def measured(*args, **more):
            found[name] = (*args, *more.values())
            return rows

        monkeypatch.setattr(module, name, measured)

    def row(name, samples, median):
        return EvaluationRow(name, samples, Timing(median, 0.75 * median, 1.5 * median))

    give(evaluation, "evaluate_batches", [row("error", 1000, 4e-6), row("correct", 1000, 9e-6)])
    give(evaluation, "evaluate_peers", ([row("numpy", 500, 2e-5)], ["zeta", "alpha"]))
    give(evaluation, "evaluate_small", [row("error of 37", 37, 3.7e-6)])
    give(evaluation, "evaluate_single", [row("step", 1, 2.5e-7)])
    give(fit, "quick_fits", [FitRow(Case(2000, 17), "fit", Timing(3e-4, 2.5e-4, 4e-4), 0.0)])
    give(fit, "fit_peers", ([], ["beta", "zeta"]))
    one = MeasuredWork("correct", 10_000, 17, 1, Timing(2e-3, 1e-3, 5e-3))
    two = MeasuredWork("fit", 1000, 17, 2, Timing(6e-3, 3e-3, 7e-3))
    give(scaling, "scaling_by_readings", [one, two])
    give(scaling, "scaling_by_orders", [one._replace(work="moments", orders=64)])
    give(scaling, "scaling_by_workers", [one._replace(work="fit of logs", threads=3)])
    give(scaling, "scaling_by_units", [one._replace(work="fleet", readings=1800)])
    give(scaling, "scaling_by_windows", [one._replace(work="watch, 500", readings=500)])
    give(scaling, "work_costs", [
        WorkCost("correct", 1, 4e-6, 2.5e-9, 0.07), WorkCost("fit", 2, 9e-6, 5e-9, 0.12),
    ])  # fmt: skip
    return found


def printed(capsys, *arguments):
    assert main(["bench", *arguments]) == 0
    return capsys.readouterr().out


LINES = """\
default path: {path}

batches: median (least .. greatest) ns each
  error                                            4.00 (3.00 .. 6.00)
  correct                                          9.00 (6.75 .. 13.50)

peers: median (least .. greatest) ns each
  numpy                                           40.00 (30.00 .. 60.00)

calls of 37 samples: median (least .. greatest) ns each
  error of 37                                    100.00 (75.00 .. 150.00)

single samples: median (least .. greatest) ns each
  step                                           250.00 (187.50 .. 375.00)

fits of all readings: median (least .. greatest) microseconds
  fit, 2000 x 17 orders                           300.0 (250.0 .. 400.0)
  alpha                                      not installed
  beta                                       not installed
  zeta                                       not installed
"""


def test_times_are_told_a_reading_and_a_fit(asked, capsys):
    path = json.loads(printed(capsys, "--json"))["path"]
    assert printed(capsys) == LINES.format(path=path)
    assert asked["evaluate_batches"] == (1_000_000, 5)
    assert asked["evaluate_peers"] == asked["quick_fits"] == (100_000, 5)
    assert asked["evaluate_small"] == asked["evaluate_single"] == (100,)
    printed(capsys, "--samples", "1", "--rounds", "3")
    assert asked["evaluate_batches"] == asked["evaluate_peers"] == asked["quick_fits"] == (1, 3)
    assert asked["evaluate_small"] == asked["evaluate_single"] == (60,)


def test_medians_are_plain_values(asked, capsys):
    found = json.loads(printed(capsys, "--json"))
    assert found["missing"] == ["alpha", "beta", "zeta"]
    assert found["nanoseconds"] == {
        "batches": pytest.approx({"error": 4.0, "correct": 9.0}),
        "peers": pytest.approx({"numpy": 40.0}),
        "calls_of_37_samples": pytest.approx({"error of 37": 100.0}),
        "single_samples": pytest.approx({"step": 250.0}),
        "fits": pytest.approx({"fit, 2000 readings": 3e5}),
    }


GROWN = """\
work                readings  orders threads     seconds  ns/reading
correct                10000      17       1       0.002         200
fit                     1000      17       2       0.006       6e+03
moments                10000      64       1       0.002         200
fleet                   1800      17       1       0.002    1.11e+03
watch, 500               500      17       1       0.002       4e+03

model of cost, 17 orders: seconds = call + readings x each
  correct, 1 thread: 4 us + 2.5 ns a reading (within 7 %); 1e12 readings: 0.694 h
  fit, 2 threads: 9 us + 5 ns a reading (within 12 %); 1e12 readings: 1.39 h
"""


def test_how_time_grows_is_told_line_by_line(asked, capsys):
    assert printed(capsys, "--scaling") == GROWN
    assert asked["scaling_by_readings"] == (10_000_000, 5)
    some = min(10_000_000, scaling.READINGS)
    assert asked["scaling_by_orders"] == (5, some // 64, some)
    assert asked["scaling_by_units"] == (1000,)
    assert asked["scaling_by_windows"] == (some, 5)
    assert "scaling_by_workers" not in asked
    lines = printed(capsys, "--scaling", "--largest", "2e4", "--workers", "1,3", "--rounds", "2")
    assert "fit of logs            10000      17       3" in lines
    assert asked["scaling_by_workers"] == ([1, 3], 20_000)
    assert asked["scaling_by_orders"] == (2, 312, 20_000)
    assert asked["scaling_by_units"] == (2,)


def test_what_grew_is_plain_values(asked, capsys):
    found = json.loads(printed(capsys, "--scaling", "--json"))
    first = found["measured"][0]
    assert (first["timing"], first["least"], first["threads"]) == (2e-3, 1e-3, 1)
    assert [row["work"] for row in found["measured"]] == [
        "correct", "fit", "moments", "fleet", "watch, 500",
    ]  # fmt: skip
    assert found["costs"][1] == {
        "work": "fit", "threads": 2, "call": 9e-6, "reading": 5e-9, "spread": 0.12,
    }  # fmt: skip


@pytest.mark.parametrize("words", [["--rounds", "0"], ["--samples", "-1"]])
def test_numbers_below_one_are_refused_with_what_was_given(words, asked, capsys):
    assert main(["bench", *words]) == 1
    given = {"--samples": 1_000_000, "--rounds": 5, words[0]: int(words[1])}
    assert capsys.readouterr().err == (
        "trueangle: error: --samples and --rounds must be 1 or more, got "
        f"{given['--samples']} and {given['--rounds']}\n"
    )


@pytest.mark.parametrize(
    ("largest", "refused"), [("1e3", False), ("999", True), ("1e10", False), ("1.1e10", True)]
)
def test_readings_lie_between_a_thousand_and_ten_milliards(largest, refused, asked, capsys):
    assert main(["bench", "--scaling", "--largest", largest]) == (1 if refused else 0)
    told = capsys.readouterr()
    if refused:
        assert told.err == (
            "trueangle: error: --largest must lie between 1e3 and 1e10, --rounds and --workers "
            f"must be whole numbers from 1, got --largest {float(largest):g} --rounds 5\n"
        )


def test_the_picture_has_dots_and_lines_of_its_numbers(asked, capsys, tmp_path, monkeypatch):
    pytest.importorskip("matplotlib").use("Agg")
    from trueangle.cli import bench

    drawn = []
    monkeypatch.setattr(bench, "save_picture", lambda ax, path: drawn.append((ax, path)))
    printed(capsys, "--scaling", "--plot", str(tmp_path / "p.svg"))
    ((ax, path),) = drawn
    assert path == str(tmp_path / "p.svg")
    assert ax.get_label() == (
        "Seconds over readings: correct, 1 thread: 1e+04 in 0.002 s; fit, 2 threads: 1e+03 in "
        "0.006 s."
    )
    assert [text.get_text() for text in ax.get_legend().get_texts()] == [
        "correct, 1 thread", "fit, 2 threads",
    ]  # fmt: skip
    assert (ax.get_xlabel(), ax.get_xscale(), ax.get_yscale()) == ("readings", "log", "log")
    assert ax.get_ylabel() == "seconds: medians, and the model of cost"
    dots, line, *_ = ax.lines
    assert (dots.get_xdata().tolist(), dots.get_ydata().tolist()) == ([10_000.0], [2e-3])
    assert line.get_ydata()[0] == pytest.approx(4e-6 + 2.5e-9 * 10_000)
