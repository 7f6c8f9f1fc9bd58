"""Which size of a table is taken for a largest difference: the first of its sizes that keeps it."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.export.targets import TARGETS

from .conftest import ARCSEC, golden_model

#: Targets of tables with places in degrees, with a difference that some of their sizes keep.
IN_DEGREES = {"csv": 60.0, "linuxcnc": 60.0, "siemens840d": 60.0, "twincat": 60.0}


def options_of(target):
    return {"bits": 12} if "bits" in TARGETS[target].options else {}


def kept_at(target, size, largest, **options):
    """Whether a table of so many entries keeps it."""
    try:
        made = ta.export_model(golden_model(), target, entries=size, **options)
    except ArgumentError:  # too few for the orders
        return False
    return made.max_difference_arcsec <= largest


@pytest.mark.parametrize("target", IN_DEGREES)
def test_lines_of_a_table_stand_at_degrees_that_one_can_read(target):
    """Hundredths of a degree, from few lines to many: nobody looks for 5.901639344 deg."""
    sizes = TARGETS[target].sizes({})
    assert list(sizes) == sorted(set(sizes))
    assert [size for size in sizes if 36_000 % size] == []


@pytest.mark.parametrize("target", IN_DEGREES)
def test_the_first_size_that_keeps_the_difference_is_taken(target):
    largest, options = IN_DEGREES[target], options_of(target)
    sizes = TARGETS[target].sizes({})
    made = ta.export_model(golden_model(), target, max_arcsec=largest, **options)
    wanted = next(size for size in sizes if kept_at(target, size, largest, **options))
    assert made.max_difference_arcsec <= largest
    assert (
        made.entries == ta.export_model(golden_model(), target, entries=wanted, **options).entries
    )
    assert wanted not in (sizes[0], sizes[-1])


def kept_by_lines(model, entries):
    options = {"bits": 12, "method": "linear", "entries": entries}
    return ta.export_model(model, "c", **options).max_difference_arcsec


def test_who_asks_for_lines_gets_many_and_who_does_not_gets_cubics_where_these_are_smaller(model):
    """With a model so well known that lines of 32 bits are taken."""
    size = 1 + 2 * len(model.orders)
    sure = model.replace(covariance=np.eye(size) * (1e-6 * ARCSEC) ** 2)
    largest = 0.005
    cubics = ta.export_model(sure, "c", max_arcsec=largest, bits=12)
    lines = ta.export_model(sure, "c", max_arcsec=largest, bits=12, method="linear")
    whole = ta.export_model(sure, "c", max_arcsec=largest, bits=12, number="q31")
    assert {row["method"] for row in cubics.tables} == {"cubic"}
    assert {row["method"] for row in (*lines.tables, *whole.tables)} == {"linear"}
    for made in (cubics, lines, whole):
        assert made.max_difference_arcsec <= largest
    assert cubics.bytes < lines.bytes == whole.bytes
    # Half of them do not keep it.
    with pytest.raises(ArgumentError, match="differs by"):
        ta.export_model(
            sure, "c", max_arcsec=largest, bits=12, method="linear", entries=lines.entries // 2
        )
    assert lines.entries > 1024
    at_most = kept_by_lines(sure, 1024)
    for largest, method in ((1.0, "linear"), (1.001 * at_most, "linear"), (0.9 * at_most, "cubic")):
        made = ta.export_model(sure, "c", max_arcsec=largest, bits=12)
        assert {row["method"] for row in made.tables} == {method}
        assert (made.entries == 1024) == (largest == 1.001 * at_most)
