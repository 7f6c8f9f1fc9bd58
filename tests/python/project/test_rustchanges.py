"""The operators that plant faults in the core, on a few lines of Rust."""

import sys
import tomllib
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "mutants"))

from conftest import ROOT
from rustchanges import changes, switched

CODE = """\
const MOST: f64 = 2.0; // \u03bb
/// Documented.
#[inline]
pub fn size(x: &[f64], n: usize) -> f64 {
    let mut sum = [0.0; 4];
    for v in x { sum[0] += v * MOST; }
    if n < 3 && !x.is_empty() { return -sum[0]; }
    assert!(n < 9, "{}", n + 1);
    match n { 7 => 1.5f32 as f64, _ => sum.0 / 2.0 }
}
const fn fixed() -> usize { 1 + 1 }
#[cfg(test)]
mod tests { fn f() -> bool { 1 < 2 } }
"""


def made(change):
    source = CODE.encode()
    old = source[change.start : change.end].decode()
    return change.line, change.operator, old, change.new


def test_every_operator_is_offered_where_a_switch_can_stand():
    found = [made(change) for change in changes(CODE)]
    assert sorted(found) == sorted(
        [
            *((4, "at once", "", f" return {value};") for value in ("0.0", "1.0")),
            *((5, "number", "0.0", new) for new in ("(1.0)", "(-1.0)")),
            (6, "no loop", "x", "(x).into_iter().take(0)"),
            (6, "number", "0", "1"),
            (6, "+= to -=", "sum[0] += v * MOST", "sum[0] -= v * MOST"),
            (6, "* to /", "v * MOST", "v / MOST"),
            (6, "constant", "MOST", "(MOST + MOST)"),
            (7, "turned round", "n < 3 && !x.is_empty()", "!(n < 3 && !x.is_empty())"),
            (7, "&& to ||", "n < 3 && !x.is_empty()", "n < 3 || !x.is_empty()"),
            *((7, f"< to {s}", "n < 3", f"n {s} 3") for s in ("<=", ">=")),
            *((7, "number", "3", new) for new in ("4", "2")),
            (7, "without !", "!x.is_empty()", "x.is_empty()"),
            (7, "without -", "-sum[0]", "sum[0]"),
            (7, "number", "0", "1"),
            *((9, "number", "1.5f32", new) for new in ("(2.5f32)", "(0.5f32)")),
            (9, "/ to *", "sum.0 / 2.0", "sum.0 * 2.0"),
            *((9, "number", "2.0", new) for new in ("(3.0)", "(1.0)")),
        ]
    )


def test_each_fault_stands_behind_its_question_on_its_own_line():
    chosen = [c for c in changes(CODE) if c.operator in ("at once", "no loop", "* to /")][1:]
    text, places = switched(CODE, list(enumerate(chosen)))
    new = text.splitlines()
    assert "if crate::planted::is(0) { return 1.0; }" in new[3]
    assert "(x).into_iter().take(if crate::planted::is(1) { 0 } else { usize::MAX })" in new[5]
    assert "(if crate::planted::is(2) {v / MOST } else { v * MOST })" in new[5]
    assert len(new) == len(CODE.splitlines())
    for place in places:
        assert b"crate::planted::is" in text.encode()[place.start : place.stop]
    assert switched(CODE, []) == (CODE, [])


def test_what_is_excused_stands_where_it_is_said():
    listed = ROOT / "tests" / "mutants" / "equivalent.toml"
    entries = tomllib.loads(listed.read_text(encoding="utf-8"))["equivalent"]
    assert len(entries) > 30
    for entry in entries:
        lines = (ROOT / entry["file"]).read_text(encoding="utf-8").splitlines()
        assert entry["before"] in [line.strip() for line in lines], entry
        assert entry["after"] != entry["before"]
        assert entry["because"]
    places = [(entry["file"], entry["before"], entry["after"]) for entry in entries]
    assert len(places) == len(set(places))
