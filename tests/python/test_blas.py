"""Threads of numpy's linear algebra while a diagnosis runs."""

import threading

import numpy as np
import pytest

from trueangle.blas import blas_threads, one_blas_thread


@pytest.fixture
def count():
    """Asks for the threads, of which there are two outside."""
    found = blas_threads()
    if found is None:
        pytest.skip("numpy brought no OpenBLAS")
    asks, sets = found
    before = asks()
    sets(2)
    yield asks
    sets(before)


def test_there_is_one_thread_inside_and_as_many_as_before_outside(count):
    with one_blas_thread():
        assert count() == 1
        with one_blas_thread():
            assert count() == 1
        assert count() == 1
    assert count() == 2


def test_an_error_gives_them_back(count):
    with pytest.raises(ZeroDivisionError), one_blas_thread():
        raise ZeroDivisionError
    assert count() == 2


def test_those_who_overlap_give_them_back_at_the_end_of_the_last(count):
    inside, leave = threading.Event(), threading.Event()

    def work():
        with one_blas_thread():
            inside.set()
            leave.wait(10.0)

    other = threading.Thread(target=work)
    other.start()
    assert inside.wait(10.0)
    with one_blas_thread():
        pass
    assert count() == 1
    leave.set()
    other.join()
    assert count() == 2


def test_products_are_those_of_two_threads(count):
    x = np.random.default_rng(2).standard_normal((400, 300))
    two = x.T @ x
    with one_blas_thread():
        one = x.T @ x
    np.testing.assert_allclose(one, two, rtol=1e-13, atol=1e-11)
