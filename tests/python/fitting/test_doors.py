"""The same readings give the same model by every door: files, folders, formats, one pass."""

import json
import math
import shutil

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

#: Coefficients agree to this part of the greatest: what rounding in sums of other groups leaves.
SAME = 1e-9
#: Unit, its turn, and what a column's name says of it.
UNITS = {"deg": 360.0, "rad": 2.0 * math.pi, "turn": 1.0, "count": 65536.0}


class Joint:
    """A joint drawn at random, with runs of readings of it."""

    def __init__(self, seed, partial=False, unit="deg", outliers=False, rows=None):
        rng = np.random.default_rng(seed)
        print(f"seed {seed}")
        self.unit, self.turn = unit, UNITS[unit]
        self.ratio = float(rng.choice([0.0, 50.0, 100.0])) or None
        orders = {int(k) for k in rng.integers(1, 18, 3)}
        if self.ratio is None:
            orders.add(int(rng.choice([25, 41, 73, 97])))
        else:
            orders.add(int(self.ratio))
        if partial:
            orders, self.ratio = {1, 2, 5}, None
        sizes = {k: rng.uniform(0.004, 0.1) for k in sorted(orders)}
        phases = {k: rng.uniform(0.0, 2.0 * math.pi) for k in sizes}
        noise = 10.0 ** rng.uniform(-3.5, -2.5)
        self.runs = []
        for _ in range(int(rng.integers(1, 6))):
            count = rows or int(rng.integers(1500, 4000))
            if partial:
                angle = 40.0 + 95.0 * np.sin(np.linspace(0.0, rng.uniform(20.0, 40.0), count))
            else:
                angle = np.linspace(0.0, 360.0 * int(rng.integers(2, 5)), count, endpoint=False)
            error = sum(c * np.sin(k * np.radians(angle) + phases[k]) for k, c in sizes.items())
            error = error + rng.normal(0.0, noise, count) + rng.uniform(-20.0, 20.0)
            if outliers:
                error[rng.integers(0, count, 3)] += rng.uniform(1.0, 4.0, 3)
            self.runs.append((angle / 360.0, (angle + error) / 360.0))

    @property
    def options(self):
        """Of the command."""
        given = [] if self.ratio is None else ["--gear-ratio", f"{self.ratio:g}"]
        return given + (["--counts-per-turn", "65536"] if self.unit == "count" else [])

    def table(self, runs):
        """Columns of some runs, a label each."""
        reference = "deg" if self.unit == "count" else self.unit
        true, said = (np.concatenate([self.runs[i][j] for i in runs]) for j in (0, 1))
        labels = [f"s{i}" for i in runs for _ in self.runs[i][0]]
        return {
            "run": labels,
            f"reference_{reference}": true * UNITS[reference],
            f"indicated_{self.unit}": said * self.turn,
        }

    def write(self, path, runs):
        """A file of some runs."""
        table = self.table(runs)
        if path.suffix == ".parquet":
            pq.write_table(pa.table(table), path, row_group_size=999)
            return
        columns = [values if name == "run" else values.tolist() for name, values in table.items()]
        rows = (",".join(map(str, row)) for row in zip(*columns, strict=True))
        path.write_text("\n".join([",".join(table), *rows]))


def parts_of(joint, seed):
    """The runs dealt to files, in their order."""
    count = len(joint.runs)
    cuts = np.random.default_rng(seed).integers(1, 3, count).cumsum()
    ends = sorted({min(int(cut), count) for cut in cuts})
    return [range(a, b) for a, b in zip([0, *ends], ends, strict=False) if b > a]


def doors(joint, folder, seed):
    """Arguments of ``fit``, by the name of the door."""
    whole, split, columns, nested = (folder / name for name in ("whole", "split", "pq", "nested"))
    for place in (whole, split, columns, nested / "below"):
        place.mkdir(parents=True)
    joint.write(whole / "all.csv", range(len(joint.runs)))
    for i, runs in enumerate(parts_of(joint, seed)):
        joint.write(split / f"{i}.csv", runs)
        joint.write(columns / f"{i}.parquet", runs)
        shutil.copy(columns / f"{i}.parquet", nested / "below" / f"{i}.parquet")
    files = [str(path) for path in sorted(split.iterdir())]
    return {
        "pattern": [str(split / "*.csv")],
        "pattern of folders": [str(folder / "nest[a-f]d" / "**" / "?.parquet")],
        "pattern, one pass": [str(columns / "*.parquet"), "--one-pass"],
        "file": [str(whole / "all.csv")],
        "files": files,
        "folder of one": [str(whole)],
        "folder": [str(split)],
        "parquet": [str(columns)],
        "nested": [str(nested)],
        "one pass": [str(whole / "all.csv"), "--one-pass"],
        "folder, one pass": [str(split), "--one-pass"],
        "parquet, one pass": [str(columns), "--one-pass"],
    }


def answer(arguments, joint, folder, capsys):
    """What ``fit --json`` says, and the model without its file's names."""
    model = folder / "m.json"
    capsys.readouterr()
    status = main(["fit", *arguments, *joint.options, "-o", str(model), "--json"])
    out, err = capsys.readouterr()
    assert status == 0, err
    said, kept = json.loads(out), json.loads(model.read_text())
    del said["model"], kept["provenance"]
    return said, kept


CASES = [
    *({"seed": seed, "unit": unit} for seed, unit in zip(range(4), UNITS, strict=True)),
    {"seed": 11, "outliers": True},
    {"seed": 12, "partial": True, "unit": "rad"},
    {"seed": 13, "partial": True, "outliers": True},
]


@pytest.mark.parametrize("case", CASES, ids=lambda case: "-".join(map(str, case.values())))
def test_every_door_gives_the_same_answer(case, tmp_path, capsys):
    joint = Joint(**case)
    found = {
        name: answer(arguments, joint, tmp_path, capsys)
        for name, arguments in doors(joint, tmp_path, case["seed"]).items()
    }
    said, kept = found.pop("file")
    for name, (other, model) in found.items():
        assert other == said, name
        assert model == kept, name


def same_answer(summed, fitted):
    """Orders, coefficients, zeros, span, outliers and notes of two fits agree."""
    assert [(s.name, s.orders) for s in summed.model.shafts] == [
        (s.name, s.orders) for s in fitted.model.shafts
    ]
    for kind in ("cosine", "sine"):
        mine, theirs = (
            np.concatenate([getattr(s, kind) for s in fit.model.shafts]) for fit in (summed, fitted)
        )
        bound = SAME * fitted.model.amplitudes.max()
        np.testing.assert_allclose(mine, theirs, rtol=0, atol=bound)
    period = fitted.model.period
    np.testing.assert_allclose(summed.offsets, fitted.offsets, rtol=0, atol=SAME * period)
    assert summed.wild == fitted.wild
    if fitted.model.partial_span is None:
        assert summed.model.partial_span is None
    else:
        np.testing.assert_allclose(
            summed.model.partial_span, fitted.model.partial_span, rtol=0, atol=1e-12 * period
        )
    assert summed.readings == fitted.readings
    assert [note for note in summed.notes if "in one pass" not in note] == list(fitted.notes)
    assert sum("in one pass" in note for note in summed.notes) == 1


@pytest.fixture
def few_kept(monkeypatch):
    """One pass keeps a part of the readings only."""
    monkeypatch.setattr("trueangle.logs.fitting.KEPT", 30_000)
    monkeypatch.setattr("trueangle.formats.parquet._STRETCH", 20_000)


@pytest.mark.parametrize("partial", [False, True])
@pytest.mark.parametrize("outliers", [False, True])
@pytest.mark.parametrize("seed", [21, 22, 23])
def test_sums_of_more_readings_than_are_kept_say_what_memory_says(
    seed, outliers, partial, tmp_path, few_kept
):
    joint = Joint(seed, partial=partial, outliers=outliers, rows=35_000)
    for i, runs in enumerate(parts_of(joint, seed)):
        joint.write(tmp_path / f"{i}.parquet", runs)
    files = sorted(tmp_path.glob("*.parquet"))
    options = {"gear_ratio": joint.ratio}
    try:
        fitted = ta.fit(ta.read_runs(files), **options)
    except ta.errors.NoModelError:
        with pytest.raises(ta.errors.NoModelError):
            ta.fit_logs(tmp_path, **options)
        return
    summed = ta.fit_logs(tmp_path, **options)
    assert summed.moments is not None
    same_answer(summed, fitted)


def test_no_reading_of_a_fit_is_outside_its_own_span(tmp_path, few_kept):
    angle = 2.6 * np.sin(np.linspace(0.0, 90.0, 70_001))
    error = 0.01 * np.sin(2.0 * angle) + np.random.default_rng(3).normal(0.0, 1e-4, angle.size)
    table = {"reference_rad": angle, "indicated_rad": angle + error}
    pq.write_table(pa.table(table), tmp_path / "a.parquet")
    run = ta.CalibrationRun(angle, angle + error)
    for found in (ta.fit_logs(tmp_path, [1, 2]), ta.fit(run, [1, 2])):
        start, stop = found.model.partial_span
        offset = np.mod(angle - start, 2.0 * np.pi)
        rounding = 1e-12
        outside = (offset > stop - start + rounding) & (offset < 2.0 * np.pi - rounding)
        assert not outside.any()
        assert stop - start == pytest.approx(5.2, abs=1e-6)


def test_what_one_pass_does_not_keep_is_refused_in_words(tmp_path, few_kept):
    joint = Joint(31, rows=40_000)
    joint.write(tmp_path / "a.parquet", range(len(joint.runs)))
    found = ta.fit_logs(tmp_path, [1, 2])
    for ask in (lambda: found.residuals, lambda: found.runs, found.plot):
        with pytest.raises(ta.errors.ArgumentError, match="summed in one pass"):
            ask()
    assert found.weights is None
    assert (
        found.to_dict().keys() == ta.fit(ta.read_runs(tmp_path / "a.parquet"), [1]).to_dict().keys()
    )


def frames(table):
    """The table as every library holds one, by the name of the library."""
    import dask.dataframe as dd
    import duckdb
    import pandas as pd
    import polars as pl
    import xarray as xr

    arrow = pa.table(table)
    pandas = pd.DataFrame(table)
    records = np.rec.fromarrays(list(table.values()), names=list(table))
    return {
        "dict": table,
        "records": records,
        "pandas": pandas,
        "pandas of Arrow": pandas.convert_dtypes(dtype_backend="pyarrow"),
        "polars": pl.DataFrame(table),
        "lazy polars": pl.DataFrame(table).lazy(),
        "Arrow": arrow,
        "Arrow batches": arrow.to_reader(max_chunksize=999),
        "DuckDB": duckdb.from_arrow(arrow),
        "xarray": xr.Dataset({name: ("row", values) for name, values in table.items()}),
        "dask": dd.from_pandas(pandas, npartitions=3, sort=False),
        "list of one": [table],
    }


def without(plain, *names):
    """A plain result without what names its files, tells the time or was written."""
    if isinstance(plain, dict):
        return {k: without(v, *names) for k, v in plain.items() if k not in names}
    if isinstance(plain, list):
        return [without(value, *names) for value in plain]
    return plain


#: Every verb that takes readings, and its answer as plain values.
VERBS = {
    "fit": lambda data, **o: without(ta.fit(data, [1, 2], **o).to_dict(), "files", "inputs"),
    "orders": lambda data, **o: ta.select_orders(data, range(1, 9), **o).to_dict(),
    "check": lambda data, **o: ta.check(data, **o).to_dict(),
    "read_runs": lambda data, **o: [
        (run.label, run.period, run.reference.tolist(), run.indicated.tolist(), run.time.tolist())
        for run in ta.read_runs(data, **o)
    ],
    "diagnose": lambda data, **o: without(
        ta.diagnose(data, ta.Simulation(), gain=False, **o).to_dict(), "seconds", "extended"
    ),
    "report": lambda data, **o: without(
        ta.report(data, orders=[1, 2], **o).content, "provenance", "title"
    ),
    "selfcal": lambda data, **o: without(
        ta.selfcal(data, orders=[1, 2], method="spin-down", **o).to_dict(), "source", "sources"
    ),
}


def few_readings(seed):
    """Columns of two short runs that turn evenly."""
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    time = np.tile(np.arange(400) * 0.01, 2)
    turned = np.tile(np.arange(400) * 2.9, 2) + np.repeat([0.0, 1.4], 400)
    error = 0.05 * np.sin(np.radians(turned) + 0.3) + 0.02 * np.cos(2.0 * np.radians(turned))
    return {
        "run": np.repeat(["a", "b"], 400),
        "time_s": time,
        "reference_deg": turned,
        "indicated_deg": turned + error + rng.normal(0.0, 1e-3, turned.size),
    }


def written(table, path):
    rows = (
        ",".join(map(str, row)) for row in zip(*(v.tolist() for v in table.values()), strict=True)
    )
    path.write_text("\n".join([",".join(table), *rows]))
    return path


@pytest.mark.parametrize("verb", VERBS)
def test_every_table_in_memory_gives_the_answer_of_its_file(verb, tmp_path):
    table = few_readings(41)
    wanted = VERBS[verb](written(table, tmp_path / "a.csv"))
    cheap = ("fit", "check", "read_runs")
    few = ("lazy polars", "DuckDB", "xarray")  # of those verbs that take long
    for library, data in frames(table).items():
        if verb in cheap or library in few:
            assert VERBS[verb](data) == wanted, library
    for data in (tmp_path, str(tmp_path / "*.csv"), [tmp_path / "a.csv"]):
        if verb in cheap or data == tmp_path:
            assert VERBS[verb](data) == wanted, data


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_reads_columns_by_the_same_keywords(verb):
    table = few_readings(42)
    wanted = VERBS[verb](table)
    names = {"run": "series", "time_s": "t", "reference_deg": "ref", "indicated_deg": "enc"}
    other = {names[name]: values for name, values in table.items()}
    signals = {"time": "t", "reference": ("ref", "deg"), "indicated": "enc"}
    given = {"by": "series", "signals": signals, "period": 360.0}
    assert without(VERBS[verb](other, **given), "columns") == without(wanted, "columns")
    with pytest.raises(TypeError, match=r"'signal'.*did you mean signals"):
        VERBS[verb](other, signal=signals)


@pytest.mark.parametrize("period", [360.0, 2.0 * math.pi, 1.0, 65536.0])
def test_a_period_is_the_unit_of_columns_that_name_none(period):
    table = few_readings(43)
    scale = period / 360.0
    bare = {
        name.removesuffix("_deg"): values * scale if name.endswith("_deg") else values
        for name, values in table.items()
    }
    found, wanted = ta.read_runs(bare, period=period), ta.read_runs(table)
    for kind in ("reference", "indicated"):
        mine, theirs = (getattr(runs[0], kind) / runs[0].period for runs in (found, wanted))
        np.testing.assert_allclose(mine, theirs, rtol=1e-14, atol=1e-14)


def test_empty_cells_of_a_table_are_left_out_as_those_of_its_file(tmp_path):
    import pandas as pd

    table = few_readings(44)
    frame = pd.DataFrame(table).convert_dtypes(dtype_backend="pyarrow")
    frame.loc[7, "indicated_deg"] = None
    frame.to_csv(tmp_path / "a.csv", index=False)
    for data in (frame, tmp_path / "a.csv", frame.astype({"indicated_deg": object})):
        with pytest.warns(ta.errors.EmptyCellsWarning, match="1 of 800 rows"):
            runs = ta.read_runs(data)
        assert [run.left_out for run in runs] == [1, 0]


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (5, "runs must be paths, runs, or tables .* got 5"),
        ([], "runs is empty"),
        (
            [{"reference_deg": [1.0], "indicated_deg": [1.0]}, 5],
            r"runs\[1\] must be a path, a run or a table, got 5",
        ),
        ({"reference_deg": [1.0]}, "no column indicated_deg"),
        ({1: [2.0]}, "columns must have text for names"),
        ({"reference_deg": [1.0, 2.0], "indicated_deg": [1.0]}, "equally long"),
        ("nothing*.csv", "no file matches this pattern"),
    ],
)
def test_what_holds_no_readings_is_refused_in_words(data, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ta.TrueAngleError, match=says):
        ta.fit(data, [1])


def test_an_unquoted_name_with_brackets_is_a_file(tmp_path):
    path = written(few_readings(45), tmp_path / "run[1].csv")
    assert len(ta.read_runs(path)) == 2
    assert main(["check", str(path)]) == 0
