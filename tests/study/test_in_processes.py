"""Parts of a study side by side: the same results, and no silence when one is killed."""

import operator
import os

import pytest

from verify.study.in_processes import in_processes

FACTORS = [(2, 3), (5, 7), (11, 13)]


def killed(*part):
    os._exit(9)


@pytest.mark.parametrize("processes", [1, 2])
def test_every_call_is_answered_whatever_the_number_of_processes(processes):
    found = dict(in_processes(operator.mul, FACTORS, processes))
    assert found == {0: 6, 1: 35, 2: 143}


@pytest.mark.parametrize("processes", [1, 2])
def test_what_a_call_raises_is_raised(processes):
    with pytest.raises(ZeroDivisionError):
        list(in_processes(operator.truediv, [(1, 0)], processes))


def test_a_killed_process_is_an_error_that_says_so():
    with pytest.raises(ChildProcessError, match="was killed"):
        list(in_processes(killed, [()], 2))
