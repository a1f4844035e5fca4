"""Schedules: every foot stands its share, feet lift in the order that names the gait."""

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.optimize import linprog

from fbid_gym.errors import UnknownOptionError
from fbid_gym.motions.gait.gait import gait_of
from fbid_gym.motions.gait.schedule import PATTERNS, Schedule, schedule_of, since_lift
from fbid_gym.robots import load
from tests.dogs import dog

PHASES = (np.arange(10000) + 0.5) / 10000.0


def planned_contacts(schedule: Schedule, phases: np.ndarray) -> np.ndarray:
    """Which feet shall stand, (N, F) bool, at phases (N,)."""
    feet = range(len(schedule.lift))
    passed = [[since_lift(schedule, phase, foot) for foot in feet] for phase in phases]
    return np.array(passed) >= 1.0 - schedule.duty


@pytest.mark.parametrize("gait", PATTERNS)
def test_every_foot_stands_its_share_of_the_cycle_in_one_go(gait):
    schedule = schedule_of(load("quadruped"), gait)
    planted = planned_contacts(schedule, PHASES)
    assert planted.mean(axis=0) == pytest.approx(schedule.duty, abs=1e-3)
    switches = (planted != np.roll(planted, 1, axis=0)).sum(axis=0)
    assert (switches == (0 if schedule.duty == 1.0 else 2)).all()
    # At its phase of lifting, a foot leaves the ground.
    for foot, lift in enumerate(schedule.lift):
        around = planned_contacts(schedule, np.array([lift - 1e-9, lift + 1e-9]) % 1.0)
        assert around[:, foot].tolist() == [True, gait == "stand"]


@pytest.mark.parametrize(
    ("gait", "mate"), [("trot", 3), ("short_trot", 3), ("pace", 2), ("bound", 1)]
)
def test_pairs_move_together_and_half_a_cycle_apart(gait, mate):
    robot = load("quadruped")
    assert robot.foot_names == ("front_left", "front_right", "hind_left", "hind_right")
    lift = schedule_of(robot, gait).lift
    assert lift[0] == lift[mate]
    one, other = {1, 2, 3} - {mate}
    assert lift[one] == lift[other]
    assert abs(lift[0] - lift[one]) == 0.5


def test_a_walk_keeps_three_feet_on_the_ground():
    planted = planned_contacts(schedule_of(load("quadruped"), "walk"), PHASES)
    assert planted.sum(axis=1).min() == 3


def test_the_order_of_the_feet_in_the_file_does_not_matter():
    names, same = (
        dict(zip(robot.foot_names, schedule_of(robot, "walk").lift, strict=True))
        for robot in (dog(), load("quadruped"))
    )
    assert names == same


def test_the_period_is_that_of_the_pendulum():
    small, large = schedule_of(dog(1.0)), schedule_of(dog(4.0))
    assert large.period == pytest.approx(2.0 * small.period)
    assert large.duty == small.duty
    asked = schedule_of(dog(1.0), period=0.5 * PATTERNS["trot"].period)
    assert asked.period == pytest.approx(0.5 * small.period)


def test_a_biped_steps_twice_in_a_cycle():
    usual, slow = (gait_of(load("biped"), 500, period=cycle).constants for cycle in (None, 6.8))
    assert slow.single == pytest.approx(2.0 * usual.single)
    assert slow.double == pytest.approx(2.0 * usual.double)
    assert usual.omega * (usual.single + usual.double) == pytest.approx(1.7)


def carries(feet: np.ndarray, friction: float) -> bool:
    """Whether forces on feet (F, 3), seen from the centre of mass, carry it without a moment."""
    angles, crosses = np.arange(64) * np.pi / 32.0, [np.cross(foot, np.eye(3)).T for foot in feet]
    facets = np.stack([np.cos(angles), np.sin(angles), np.full(64, -friction)], axis=1)
    balance = np.vstack([np.hstack(crosses), np.tile([0.0, 0.0, 1.0], len(feet))])
    cones, wrench = block_diag(*[facets] * len(feet)), [0.0, 0.0, 0.0, 1.0]
    size = cones.shape[1]
    found = linprog(np.zeros(size), cones, np.zeros(len(cones)), balance, wrench, (None, None))
    return found.success


@pytest.mark.parametrize("gait", PATTERNS)
def test_the_friction_that_a_gait_needs_carries_it_and_less_does_not(gait):
    made = gait_of(load("go1"), 250, gait)
    walk, height = made.constants, 9.81 / made.omega**2
    feet = np.insert(walk.place, 2, -height, axis=1)
    standing = planned_contacts(walk.schedule, PHASES[::100])
    assert all(carries(feet[stands], 1.01 * made.friction + 1e-6) for stands in standing)
    if made.friction > 0.0:
        assert not all(carries(feet[stands], 0.99 * made.friction) for stands in standing)


def test_bad_input_is_refused():
    known = "trot, short_trot, walk, pace, bound, stand"
    with pytest.raises(UnknownOptionError, match=rf"gait.*gallop.*{known}"):
        schedule_of(load("quadruped"), "gallop")
