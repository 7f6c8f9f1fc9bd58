"""Statements of conformity, languages, as left beside as found; read back from the PDF."""

import ast
import math
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from pdftext import pdf_text
from trueangle.certificate import (
    Budget,
    Contribution,
    Identity,
    Specification,
    certify,
    conformance_probability,
    conformity,
    language,
    load_identity,
    typesetting,
)
from trueangle.errors import ArgumentError, FileError
from trueangle.plots.canvas import new_figure
from trueangle.support.distributions import normal_quantile

#: JCGM 106:2012, examples of clause 7: value, u, lower and upper limit, probability as printed.
PRINTED = {
    "breakdown voltage of a Zener diode": (-5.47, 0.05, -math.inf, -5.40, 0.92),
    "burst strength of a container": (509.7, 8.6, 490.0, math.inf, 0.99),
    "viscosity of a motor oil": (13.6, 1.8, 12.5, 16.3, 0.66),
}

#: ILAC-G8:09/2019, table 1: guard band in U (k = 2), and the risk that it names.
RISKS = {"6 sigma": (3.0, 1e-6), "3 sigma": (1.5, 0.0016), "ILAC G8:2009": (1.0, 0.025),
         "ISO 14253-1:2017": (0.83, 0.05), "simple acceptance": (0.0, 0.5)}  # fmt: skip


@pytest.mark.parametrize("case", PRINTED)
def test_probabilities_of_conformity_are_those_of_jcgm_106(case):
    value, standard, lower, upper, printed = PRINTED[case]
    assert conformance_probability(value, standard, lower, upper) == pytest.approx(
        printed, abs=0.005
    )


def test_a_probability_of_conformity_is_the_share_of_draws_within():
    seed = 20261123
    rng = np.random.default_rng(seed)
    for value, standard, freedom in ((9.0, 2.0, 5.0), (-9.5, 0.7, 40.0), (0.0, 8.0, math.inf)):
        draws = rng.standard_normal(200_000) if math.isinf(freedom) else rng.standard_t(
            freedom, 200_000
        )  # fmt: skip
        share = np.mean(np.abs(value + standard * draws) <= 10.0)
        found = conformance_probability(value, standard, -10.0, 10.0, freedom)
        assert found == pytest.approx(share, abs=0.005), seed
    assert conformance_probability(3.0, 0.0, -3.0, 3.0) == 1.0
    assert conformance_probability(3.1, 0.0, -3.0, 3.0) == 0.0


@pytest.mark.parametrize("rule", RISKS)
def test_the_risk_at_the_acceptance_limit_is_that_of_ilac_g8(rule):
    """Of one limit, U = 2 u: a value at AL = TL - w."""
    bands, risk = RISKS[rule]
    chance = 1.0 - conformance_probability(-2.0 * bands, 1.0, -math.inf, 0.0)
    assert chance <= risk


def rows(*pairs, standard=1.0):
    return [
        {
            "angle_deg": 10.0 * k,
            "error_arcsec": e,
            "standard_arcsec": standard,
            "degrees_of_freedom": None,
            "expanded_arcsec": u,
        }
        for k, (e, u) in enumerate(pairs)
    ]


@pytest.mark.parametrize(
    ("error", "simple", "guarded"),
    [
        (0.0, "pass", "pass"),
        (8.0, "pass", "pass"),  # at AL = TL - U
        (-8.01, "pass", "conditional_pass"),
        (10.0, "pass", "conditional_pass"),
        (10.01, "fail", "conditional_fail"),
        (-12.0, "fail", "conditional_fail"),
        (12.01, "fail", "fail"),
    ],
)
def test_statements_are_those_of_ilac_g8(error, simple, guarded):
    for rule, statement in (("simple", simple), ("guard_band", guarded)):
        found = conformity(Specification(10.0, rule), rows((1.0, 2.0), (error, 2.0)))
        assert found["statement"] == statement
        assert found["conforms"] is (statement == "pass")
        assert sum(found["counts"].values()) == 2
    assert found["worst"]["beyond_limit_arcsec"] == pytest.approx(max(abs(error) - 10.0, 0.0))
    assert found["worst"]["acceptance_limit_arcsec"] == 8.0


def test_the_worst_position_is_the_one_nearest_to_its_own_acceptance_limit():
    found = conformity(Specification(10.0, "guard_band"), rows((7.0, 0.5), (-6.0, 3.5)))
    worst = {"angle_deg": 10.0, "error_arcsec": -6.0, "expanded_arcsec": 3.5}
    assert found["worst"] == {
        **worst,
        "acceptance_limit_arcsec": 6.5,
        "beyond_limit_arcsec": 0.0,
    }
    assert found["statement"] == "pass"
    wide = conformity(Specification(10.0, "guard_band"), rows((0.0, 11.0)))
    assert wide["statement"] == "conditional_pass"  # a U beyond the limit accepts nothing
    assert not wide["conforms"]


@pytest.mark.parametrize("rule", ["simple", "guard_band"])
def test_a_joint_conforms_where_its_worst_position_is_within_the_limit_that_is_told(rule):
    rng, told = np.random.default_rng(72_200), set()
    for _ in range(200):
        pairs = zip(rng.uniform(-11.0, 11.0, 3), rng.uniform(0.5, 4.0, 3), strict=True)
        found = conformity(Specification(10.0, rule), rows(*pairs))
        worst = found["worst"]
        within = bool(abs(worst["error_arcsec"]) <= worst["acceptance_limit_arcsec"])
        assert found["conforms"] is within, found
        told.add(within)
    assert told == {True, False}


def test_a_guard_band_of_u_accepts_few_that_do_not_conform():
    """True errors anywhere, measured with U: of those accepted hardly any lies outside."""
    seed = 7
    rng = np.random.default_rng(seed)
    u = 1.0
    true = rng.uniform(-20.0, 20.0, 20_000)
    measured = true + rng.normal(0.0, u, true.size)
    spec = Specification(10.0, "guard_band")
    accepted = np.array([spec.statement(e, 2.0 * u) == "pass" for e in measured])
    outside = np.abs(true) > 10.0
    assert np.mean(outside[accepted]) < 0.025, seed
    # At the limit of acceptance itself, where the risk is greatest.
    at = true + rng.normal(0.0, u, true.size)
    near = np.abs(np.abs(at) - 8.0) < 0.1
    assert np.mean(outside[near]) < 0.025 + 3.0 * np.sqrt(0.025 / near.sum()), seed
    assert normal_quantile(0.975) < 2.0


@pytest.mark.parametrize(
    ("limit", "rule"), [(0.0, "simple"), (-1.0, "simple"), (math.nan, "simple"), (1.0, "strict")]
)
def test_a_specification_is_refused_that_decides_nothing(limit, rule):
    with pytest.raises(ArgumentError, match=r"limit_arcsec|decision_rule"):
        Specification(limit, rule)


# -- the file

FILE = """\
[certificate]
number = "1"
item = "joint"
{certificate}
[specification]
{specification}
"""


@pytest.mark.parametrize(
    ("specification", "found"),
    [
        ('limit_arcsec = 40\ndecision_rule = "simple"', Specification(40.0, "simple")),
        ('limit_deg = 0.01\ndecision_rule = "guard_band"', Specification(36.0, "guard_band")),
    ],
)
def test_a_specification_is_read(specification, found, tmp_path):
    path = tmp_path / "identity.toml"
    path.write_text(FILE.format(certificate="", specification=specification))
    assert load_identity(path).specification == found


@pytest.mark.parametrize(
    ("certificate", "specification", "says"),
    [
        ("", 'decision_rule = "simple"', "either limit_arcsec or limit_deg"),
        ("", "limit_arcsec = 1", "needs decision_rule"),
        ("", 'limit_arcsec = 1\nlimit_deg = 1\ndecision_rule = "simple"', "either"),
        ("", 'limit_arcsec = -1\ndecision_rule = "simple"', "must be positive"),
        ("", 'limit_arcsec = 1\ndecision_rule = "gard_band"', "did you mean guard_band?"),
        ("", 'limt_arcsec = 1\ndecision_rule = "simple"', "did you mean limit_arcsec?"),
        ('language = "fr"', 'limit_arcsec = 1\ndecision_rule = "simple"', "one of de, en"),
        ('logo = "none.png"', 'limit_arcsec = 1\ndecision_rule = "simple"', "logo must name"),
        ('logo = "identity.toml"', 'limit_arcsec = 1\ndecision_rule = "simple"', "logo must name"),
    ],
)
def test_a_wrong_specification_says_where(certificate, specification, says, tmp_path):
    path = tmp_path / "identity.toml"
    path.write_text(FILE.format(certificate=certificate, specification=specification))
    with pytest.raises(FileError, match=re.escape(says)):
        load_identity(path)


# -- what is made of it

PATTERN = 40.0


def runs(seed=3, temperature=None, order=1):
    rng = np.random.default_rng(seed)
    theta = np.arange(0.0, 360.0, 2.5)
    return [
        ta.CalibrationRun(
            theta,
            theta
            + (PATTERN * np.sin(np.radians(order * theta + 20.0)) + rng.normal(0.0, 1.0, 144))
            / 3600.0,
            period=360.0,
            temperature=temperature,
        )
        for _ in range(4)
    ]


WHO = Identity("1", "joint", specification=Specification(45.0, "guard_band"))


def test_values_as_left_are_those_of_the_corrected_readings():
    """The model takes half of the pattern: half is left, with a budget of its own."""
    half = ta.fit(runs(seed=1), orders=[1]).model
    shafts = [
        replace(s, cosine=0.5 * np.asarray(s.cosine), sine=0.5 * np.asarray(s.sine))
        for s in half.shafts
    ]
    half = half.replace(shafts=tuple(shafts), covariance=None, fit=None)
    content = certify(runs(seed=2), WHO, orders=[1], model=half).content
    left = content["as_left"]
    found = np.array([row["error_arcsec"] for row in content["positions"]])
    kept = np.array([row["error_arcsec"] for row in left["positions"]])
    assert kept == pytest.approx(0.5 * found, abs=0.3)
    assert np.ptp(kept) == pytest.approx(PATTERN, abs=0.5)
    assert content["conformity"]["statement"] == "pass"
    assert left["conformity"]["conformance_probability"] > 0.99
    assert not left["same_readings"]
    assert sum(line["share_percent"] for line in left["budget"]["lines"]) == pytest.approx(100.0)


def test_errors_found_and_left_stand_above_one_axis_of_angles(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    drawn = []

    def kept(*args, **how):
        figure, axes = new_figure(*args, **how)
        drawn.extend(axes)
        return figure, axes

    monkeypatch.setattr(typesetting, "new_figure", kept)
    model = ta.fit(runs(seed=1), orders=[1]).model
    typesetting.lay_out(certify(runs(seed=2), WHO, orders=[1], model=model).content, tmp_path)
    found, left = drawn
    assert "left" in left.get_ylabel()
    assert "left" not in found.get_ylabel()
    assert (found.get_xlabel(), left.get_xlabel()) == ("", "position / °")


def test_a_model_of_these_very_readings_is_told(tmp_path):
    ta.write_runs(runs(), tmp_path / "runs.csv")
    read = ta.read_runs(tmp_path / "runs.csv")
    ta.fit(read, orders=[1]).model.save(tmp_path / "m.json")
    made = ta.report(read, certificate=WHO, orders=[1], model=tmp_path / "m.json")
    assert made.content["as_left"]["same_readings"]
    assert made.content["as_left"]["model"] == "m.json"


def test_a_model_that_needs_more_than_the_readings_have_is_refused():
    model = ta.fit(runs(), orders=[1]).model
    lagging = model.replace(terms=(ta.terms.ThermalDrift(0.001, reference_C=20.0),))
    with pytest.raises(ArgumentError, match="temperature, which the readings lack"):
        certify(runs(), WHO, orders=[1], model=lagging)


def test_the_temperature_is_that_of_the_readings():
    temperature = np.linspace(19.0, 22.0, 144)
    content = certify(runs(temperature=temperature), WHO, orders=[1]).content
    assert content["temperature_recorded_C"] == pytest.approx(
        {"mean": 20.5, "low": 19.0, "high": 22.0}
    )
    assert content["temperature_C"] is None
    assert "temperature_C" not in content["not_stated"]
    plain = certify(runs(), WHO, orders=[1]).content
    assert plain["temperature_recorded_C"] is None
    assert "temperature_C" in plain["not_stated"]


@pytest.mark.parametrize("seed", range(5))
def test_shares_of_a_budget_add_up_as_they_are_printed(seed):
    rng = np.random.default_rng([20261123, seed])
    parts = rng.lognormal(0.0, 2.0, rng.integers(1, 9))
    budget = Budget(tuple(Contribution(str(k), float(u)) for k, u in enumerate(parts)))
    shares = budget.shares()
    assert math.fsum(shares) == pytest.approx(100.0, abs=1e-9), seed
    for item, share in zip(budget.contributions, shares, strict=True):
        assert abs(share - 100.0 * budget.share(item)) < 0.1, seed
    assert Budget((Contribution("none", 0.0),)).shares() == [0.0]


# -- the pages


def shape(table):
    return {key: shape(value) for key, value in table.items()} if isinstance(table, dict) else None


def test_every_language_says_the_same_things_of_the_same_values():
    folder = Path(language.__file__).parent / "texts"
    said = {name: tomllib.loads((folder / f"{name}.toml").read_text("utf-8"))
            for name in language.LANGUAGES}  # fmt: skip
    assert {"en", "de"} <= set(said)

    def values(table):
        for value in table.values():
            if isinstance(value, dict):
                yield from values(value)
            else:
                text = " ".join(value) if isinstance(value, list) else value
                yield sorted(re.findall(r"#\w+", text))

    for name in said:
        assert shape(said[name]) == shape(said["en"]), name
        assert list(values(said[name])) == list(values(said["en"])), name


LOGO = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9">'
    '<rect width="9" height="9"/></svg>'
)
TIMES = "\N{MULTIPLICATION SIGN}"

#: What a page says in each language, of the same certificate.
SAID = {
    "en": ("Calibration certificate", "Statement of conformity", "Pass", "guard band", "not stated",
           "20.5 °C (19.0 to 22.0 °C", "as left", "Least", "2.5 %"),
    "de": ("Kalibrierschein", "Aussage zur Konformität", "Bestanden", "Sicherheitsband",
           "keine Angabe", "20,5 °C (19,0 bis 22,0 °C", "nach der Justierung", "Kleinste", "2,5 %"),
}  # fmt: skip


@pytest.mark.parametrize("name", SAID)
def test_the_pdf_says_it_in_its_language(name, tmp_path):
    pytest.importorskip("typst")
    (tmp_path / "logo.svg").write_text(LOGO)
    identity = tmp_path / "identity.toml"
    identity.write_text(
        FILE.format(
            certificate=f'language = "{name}"\nlogo = "logo.svg"\naddress = "Street #1\\n*Town*"',
            specification='limit_arcsec = 45\ndecision_rule = "guard_band"',
        ),
        encoding="utf-8",
    )
    model = ta.fit(runs(seed=9), orders=[1]).model
    out = tmp_path / "c.pdf"
    made = ta.report(
        runs(temperature=np.linspace(19.0, 22.0, 144)),
        out,
        certificate=identity,
        orders=[1],
        model=model,
    )
    text = re.sub(r"\s+", " ", pdf_text(out.read_bytes()))
    for words in (*SAID[name], "Street #1", "*Town*", "ILAC-G8:09/2019"):
        assert words in text, words
    mark = "." if name == "en" else ","
    for rows_of in (made.content, made.content["as_left"]):
        d = max(
            0, 1 - math.floor(math.log10(max(p["expanded_arcsec"] for p in rows_of["positions"])))
        )
        for row in rows_of["positions"][:4]:
            assert f"{abs(row['error_arcsec']):.{d}f}".replace(".", mark) in text
    # The budget as printed: what stands in its rows makes what stands below them.
    number = rf"(\d+{mark}\d+)"
    k, u, total = re.search(rf"{number} {TIMES} {number} {number}", text).groups()
    k, u, total = (float(x.replace(",", ".")) for x in (k, u, total))
    last = 10.0 ** -len(str(total).partition(".")[2])
    assert abs(k * u - total) <= 0.5 * last * (1.0 + k) + 0.005 * u


#: What the first page says of readings that a check finds fault with, and of their verdict.
FAULTY = {
    "en": ("Fail . Greatest error: ", "which exceeds the limit by", "Runs 0 and 2 hold the same",
           "in one direction of travel", "noise and repeatability"),
    "de": ("Nicht bestanden . Größte Abweichung: ", "außerhalb der Grenze um",
           "Die Messreihen 0 und 2 enthalten dieselben", "in einer Fahrtrichtung", "Rauschen"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTY)
def test_the_first_page_states_the_verdict_and_the_faults_of_the_readings(name):
    """A copied run, one direction, 24 places met to 0.001 deg, an error of 34 for a limit of 21."""
    pytest.importorskip("typst")
    rng = np.random.default_rng(8)
    given = []
    for _ in range(2):
        theta = 15.0 * np.arange(25) + rng.uniform(-1e-3, 1e-3, 25)
        error = 34.0 * np.sin(np.radians(theta)) + rng.normal(0.0, 0.5, 25)
        given.append(ta.CalibrationRun(theta, theta + error / 3600.0, 360.0, label=str(len(given))))
    given.append(replace(given[0], label="2"))
    who = replace(WHO, language=name, specification=Specification(21.0, "simple"))
    content = certify(given, who, orders=[1]).content
    assert [row["angle_deg"] for row in content["positions"]] == list(range(0, 360, 15))
    assert [fault["fault"] for fault in content["data_faults"]] == ["duplicate_runs"]
    assert content["coverage"]["directions"] == [1]
    text = re.sub(r"\s+", " ", pdf_text(typesetting.typeset_certificate(content)))
    first, rest = text.split({"en": "page 1 of", "de": "Seite 1 von"}[name])
    for words in FAULTY[name]:
        assert words in first, words
    stated = first.split(FAULTY[name][0])[1].replace(",", ".")
    size, excess = map(float, re.findall(r"(\d+\.\d+)″", stated)[:2])
    assert size - 21.0 == pytest.approx(excess) == pytest.approx(13.0, abs=1.0)
    unknown = {"en": "reversal error (one direction of travel); delay, drift and lines in time",
               "de": "Umkehrspanne (eine Fahrtrichtung); Verzögerung, Drift"}  # fmt: skip
    assert unknown[name] in rest
    assert not re.search(r"\d[.,]000\b", text)


def constants(folder):
    """Literal parts of all strings below a folder, those within f-strings too, as one text."""
    found = []
    for path in folder.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            if isinstance(node, ast.JoinedStr):
                parts = [
                    part.value if isinstance(part, ast.Constant) else "#" for part in node.values
                ]
                found.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                found.append(node.value)
    return "\n".join(found).lower()


def test_notes_are_found_by_words_that_fits_write():
    """Whoever changes a sentence of a fit changes the one that its translation is found by."""
    package = Path(ta.__file__).parent
    written = constants(package / "fitting") + constants(package / "runs")
    for name, text in language.certificate_texts("en")["notes"].items():
        # Plurals and numbers are put in where the sentence is made.
        for part in re.split(
            r"#\w+|\b1\b|\b(?:rows?|outliers?|runs?|intervals?|positions?|readings?|is|are|one|no)\b|[.,;:()]",
            text,
        ):
            words = part.strip()
            assert len(words) < 4 or words.lower() in written, (name, words)


#: Words of English that are no German ones.
ENGLISH = re.compile(r"\b(the|of|and|is|are|not|by|for|runs?|readings?|with|between)\b")


def noted(period=360.0):
    """Fits that have something to say, each another thing."""
    rng = np.random.default_rng(33)
    theta = np.arange(0.0, 360.0, 5.0)

    def run(angle, slow=0.0, size=0.1, wrong=0.0):
        walk = slow * np.cumsum(rng.normal(size=angle.size))
        error = size * np.sin(np.radians(angle)) + walk + rng.normal(0.0, 0.002, angle.size)
        error[7] += wrong
        return ta.CalibrationRun(angle, angle + error, period, time=np.arange(angle.size) * 0.1)

    grid = np.arange(0.0, 360.0, 10.0)
    yield ta.fit([run(theta)], orders=[1])
    yield ta.fit([run(grid) for _ in range(4)], gear_ratio=100)
    yield ta.fit([run(theta[:40])], orders=[1, 2, 3])
    yield ta.fit([run(theta, wrong=5.0), run(theta)], orders=[1])
    yield ta.fit([run(theta, 0.01) for _ in range(4)], orders=[1])
    yield ta.fit([run(theta, 0.01) for _ in range(9)], orders=[1])
    yield ta.fit([run(np.arange(0.0, 360.0, 0.5), 0.01)], orders=[1], covariance="correlated")
    yield ta.fit([run(theta, 0.003) for _ in range(2)], orders=[1], nuisance="drift")
    yield ta.fit(
        [run(theta) for _ in range(2)], orders={"output": [1], "motor": [1]}, gear_ratio=1.5
    )
    with pytest.warns(ta.errors.UnlikeRunsWarning):
        yield ta.fit([*(run(theta) for _ in range(5)), run(theta, size=0.3)], orders=[1])


def test_all_notes_of_a_german_certificate_are_german():
    notes = {note for fit in noted() for note in fit.notes}
    assert len(notes) >= 9
    for note in notes:
        said = language.note_in("de", note)
        assert not ENGLISH.search(said), (note, said)
        assert said.endswith(".")
        assert language.note_in("en", note) == note


def filled(text, values):
    return re.sub(r"#(\w+)", lambda found: values[found[1]], text)


def test_every_note_is_found_by_its_own_words_and_keeps_its_values():
    """Each with other numbers in its places, which stand in the German one with a comma."""
    english, german = (language.certificate_texts(name)["notes"] for name in ("en", "de"))
    for name, text in english.items():
        places = dict.fromkeys(re.findall(r"#(\w+)", text))
        values = {place: f"{17 + 3 * k}.{k + 1}" for k, place in enumerate(places)}
        wanted = filled(german[name], {p: v.replace(".", ",") for p, v in values.items()})
        said = language.note_in("de", filled(text, values))
        assert said.lower() == wanted.lower(), name
