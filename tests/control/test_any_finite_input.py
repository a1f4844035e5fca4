"""What every law promises for any finite input, searched for robots on which one breaks it."""

import pytest
from hypothesis import given, settings

from eval.fuzz.laws import LAWS, faults_of, problems
from eval.fuzz.problems import Problem

SEARCH = settings(max_examples=12, deadline=None, derandomize=True, database=None)


@pytest.mark.parametrize("law", LAWS)
@SEARCH
@given(problem=problems(wild=False))
def test_laws_on_robots_of_any_fair_size(law, problem):
    assert list(faults_of(law, problem)) == []


@pytest.mark.parametrize("law", LAWS)
@SEARCH
@given(problem=problems(wild=True))
def test_laws_on_numbers_that_no_robot_has(law, problem):
    """Every array by itself larger or smaller by up to eight orders of magnitude."""
    assert list(faults_of(law, problem)) == []


@pytest.mark.parametrize("length", [0.05, 5e-4, 5e-6])
def test_torque_limits_hold_on_short_levers(length):
    """Levers are short beside the longest, not beside a metre."""
    problem = Problem(0, 3, 3, 1, "none", 10.0, length, 10.0)
    assert list(faults_of("distribute, garofalo2015", problem)) == []
