"""What does not fit a law is named, with what was expected."""

import functools
from typing import Any

import numpy as np
import pytest

from fbid_gym import control
from fbid_gym.control import BalanceGains, BalanceTarget, ContactLimits
from fbid_gym.control.contact_forces import wrench_scale
from fbid_gym.dynamics import centroidal_terms
from fbid_gym.errors import InvalidValueError, ShapeError
from fbid_gym.quantities import ReducedContacts
from tests.property.problems import Problem, robots_of

POSITIVE = ("torque_cost", "base_priority", "length", "wrench_cost", "motion_cost", "least_gain",
            "weight", "mass", "mobility")  # fmt: skip
UNUSED = {"foot_position", "world_from_foot", "foot_velocity", "foot_jacobian", "foot_bias",
          "base_position", "com", "world_from_base", "world_from_trunk", "com_velocity", "momentum",
          "inertia", "point_map"}  # fmt: skip
NAMES = ("orthogonal_inverse_dynamics", "limited_inverse_dynamics", "distribute",
         "operational_space_acceleration", "torque_map_ott2011", "torque_map_garofalo2015",
         "torque_map_inverse_dynamics", "desired_wrench_garofalo2015",
         "desired_wrench_ott2011")  # fmt: skip


@functools.cache
def laws() -> dict[str, dict[str, Any]]:
    """What each law is given: made, and compiled, by the first test that asks."""
    robots = robots_of(Problem(0, 4, 5, 2, "none", 10.0, 0.5, 1.0))
    terms, body = robots.terms, centroidal_terms(robots.terms, robots.velocity)
    count, rows = robots.drift.shape
    joints, nv = robots.torque.shape[1], robots.velocity.shape[1]
    contacts = ReducedContacts(robots.jacobian, robots.drift, np.tile(np.eye(rows), (count, 1, 1)))
    turns, zeros = np.tile(np.eye(3), (count, 1, 1)), np.zeros((count, 6))
    limited = {"active": np.ones((count, 2), bool), "warm_start": zeros, "wrench_cost": np.ones(6)}
    limited |= {"length": 1.0, "limits": ContactLimits(0.6), "point_map": contacts.point_map}
    contact = {"jacobian": robots.jacobian, "jacobian_bias": robots.drift}
    equations = {"mass_matrix": terms.mass_matrix, "bias": terms.bias, "base_priority": 1.0}
    equations |= contact | {"acceleration": robots.acceleration}
    task = {"task_jacobian": robots.task_jacobian, "task_bias": robots.task, "task": robots.task}
    task |= {"reference": robots.acceleration, "motion_cost": np.ones(nv), "least_gain": 0.1}
    mapped = {"terms": terms, "body": body, "contacts": contacts, "posture": robots.torque}
    mapped |= {"mobility": np.ones((count, joints))}
    wrench = {
        "gains": BalanceGains(1.0, 1.0, 1.0, 1.0),
        "target": BalanceTarget(zeros[:, :3], turns, *[zeros[:, :3]] * 3, zeros),
        **{"com": terms.com, "rotation": turns, "mass": 10.0, "axes": turns},
    }
    velocities = {"com_velocity": zeros[:, :3], "angular_velocity": zeros[:, :3]}
    shared = {"torque_map": control.torque_map_ott2011(**mapped), "wrench": robots.wrench}
    shared |= {"to_com": body.to_com, "weight": 98.1, "torque_limit": np.full(joints, 30.0)}
    return {
        "orthogonal_inverse_dynamics": equations | {"torque_cost": np.ones(joints)},
        "limited_inverse_dynamics": equations | limited,
        "operational_space_acceleration": contact | task,
        "distribute": shared | limited,
        **{f"torque_map_{n}": mapped for n in ("ott2011", "garofalo2015", "inverse_dynamics")},
        "desired_wrench_garofalo2015": wrench | {"momentum": zeros},
        "desired_wrench_ott2011": wrench | velocities,
    }


@pytest.mark.parametrize("name", NAMES)
def test_arrays_of_other_robots_and_sizes_are_refused(name):
    law, given = getattr(control, name), laws()[name]
    law(**given)
    for key, value in given.items():
        if isinstance(value, np.ndarray):
            for wrong in (value[:1], value[..., 1:]) if value.ndim > 1 else (value[1:],):
                with pytest.raises((ShapeError, InvalidValueError), match="Expected"):
                    law(**given | {key: wrong})
        elif hasattr(value, "_fields"):
            for field in set(value._fields) - (UNUSED if key != "target" else set()):
                one = value._replace(**{field: getattr(value, field)[:1]})
                with pytest.raises(ShapeError, match="has shape .* Expected"):
                    law(**given | {key: one})


@pytest.mark.parametrize("name", NAMES)
def test_numbers_that_are_not_positive_are_refused(name):
    law, given = getattr(control, name), laws()[name]
    for key in given.keys() & set(POSITIVE):
        # A robot whose own weight is no number has answers that are none.
        for bad in (0.0, -1.0, np.nan, np.inf)[: 2 if key in ("weight", "mass") else 4]:
            wrong = bad
            if np.ndim(given[key]):
                wrong = given[key].copy()
                wrong.flat[-1] = bad
            with pytest.raises(InvalidValueError, match=f"Invalid {key}: .*positive"):
                law(**given | {key: wrong})


def test_gains_and_limits_are_checked():
    uneven, indefinite = np.eye(3), np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    uneven[0, 1] = 0.5
    bad = (-1.0, (1.0, -0.1, 1.0), np.nan, np.inf, (1.0, 2.0), "stiff", None, np.ones((4, 4)))
    good = dict.fromkeys(("stiffness", "damping", "rotation_stiffness", "rotation_damping"), 1.0)
    for name in good:
        for value in (*bad, uneven, indefinite):
            expected = f"(?s)Invalid {name}: .*symmetric, without negative"
            with pytest.raises(InvalidValueError, match=expected):
                BalanceGains(**good | {name: value})
    good = {"mass": 50.0, "inertia": np.eye(3), "linear": 1.0, "rotation": 1.0}
    wrong = {"mass": "heavy", "linear": (1.0, 2.0), "rotation": np.nan, "inertia": -np.eye(3)}
    for name, value in (wrong | {"damping_ratio": 0.0}).items():
        with pytest.raises(InvalidValueError, match=f"Invalid {name}: "):
            BalanceGains.from_frequencies(**good | {name: value})
    for name, wrong in {
        "friction": [(x,) for x in (-0.1, np.inf, np.nan, "rough", np.array([0.5, -0.5]))],
        "min_normal_force": [(0.7, -1.0), (0.7, 10.0, 5.0), (0.7, np.zeros(3), np.ones(4))],
        "max_normal_force": [(0.7, 0.0, -1.0), (0.7, 0.0, np.nan)],
    }.items():
        for given in wrong:
            with pytest.raises(InvalidValueError, match=f"Invalid {name}.*Expected"):
                ContactLimits(*given)
    for cost in ([1.0, 1.0], [[1.0] * 6]):
        with pytest.raises(InvalidValueError, match=r"Invalid wrench_cost: .*positive"):
            wrench_scale(1.0, cost)


def test_what_is_given_is_left_alone():
    """And limits are those that they were made of."""
    for name, given in laws().items():
        arrays = [value for value in given.values() if isinstance(value, np.ndarray)]
        before = [value.copy() for value in arrays]
        getattr(control, name)(**given)
        for then, now in zip(before, arrays, strict=True):
            np.testing.assert_array_equal(then, now, err_msg=name)
    friction = np.full((12, 8), 0.7)
    limits = ContactLimits(friction)
    friction[:] = 0.05
    np.testing.assert_array_equal(limits.friction, 0.7)
    with pytest.raises(ValueError, match="read-only"):
        limits.friction[:] = 0.05
