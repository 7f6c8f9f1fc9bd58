"""Figures of the exam's rows from a few seeds of their own, asserted from both sides."""

import numpy as np
import pytest

from selfcalibration import exam

#: Seeds of these tests: none of the exam's.
FIRST = 7_300_000

#: Standard deviations by which an rms of a few seeds may be off: one in 15 000 beyond 4.
FAR = 4.0


def seeds(count):
    print("seeds", FIRST, "to", FIRST + count - 1)
    return range(FIRST, FIRST + count)


def test_the_limit_of_white_noise_is_met():
    # Cosine and sine of three orders: the rms of n numbers scatters by 1 / sqrt(2 n).
    figure = next(exam.limit(seeds(6)))
    print(figure)
    assert abs(figure.value - 1.0) < FAR / np.sqrt(2.0 * 6 * 6)


@pytest.mark.parametrize("row", [exam.weighed, exam.ripple, exam.wander])
def test_stated_errors_hold(row):
    # 95 % inside two standard errors: of 30 numbers 24 or fewer with probability 1 in 500.
    figure = next(row(seeds(5)))
    print(figure)
    assert figure.value >= 24 / 30


@pytest.mark.parametrize("row", [exam.one_speed, exam.loop, exam.heads])
def test_what_is_blind_is_refused(row):
    figure = next(row(seeds(5)))
    print(figure)
    assert figure.value == 1.0


def test_closure_and_dual_are_at_their_limits():
    for row, count in ((exam.closure, 12), (exam.dual, 6)):
        for figure in row(seeds(count)):
            print(figure)
            assert figure.met
