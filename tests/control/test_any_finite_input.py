"""Laws answer every finite problem with finite numbers, however dependent its contacts are."""

from typing import Any

import numpy as np
import pytest

from fbid_gym.control import (
    ContactLimits,
    limited_inverse_dynamics,
    operational_space_acceleration,
    orthogonal_inverse_dynamics,
)

COUNT = 4
DEPENDENCE = ("none", "repeated", "nearly repeated", "a row of zeros", "of rank two")


def problem(rng: np.random.Generator, dependence: str) -> tuple[np.ndarray, ...]:
    """M, h, J, a, Jdot v and a size in m, of masses and lengths from a toy's to a truck's."""
    velocities, rows = 6 + int(rng.integers(1, 20)), 3 * int(rng.integers(0, 9))
    length, mass = np.exp(rng.uniform(np.log([0.05, 1.0]), np.log([3.0, 300.0])))
    size = np.r_[np.ones(3), np.full(velocities - 3, length)]
    root = rng.normal(size=(COUNT, velocities, velocities))
    inertia = root @ root.mT / velocities + 0.05 * np.eye(velocities)
    jacobian = _jacobian(rng, dependence, rows, velocities)
    jacobian[..., 3:] *= length * rng.choice([1.0, 30.0])
    return (
        mass * inertia * size * size[:, None],
        mass * 9.81 * size * rng.normal(size=(COUNT, velocities)),
        jacobian,
        30.0 * rng.normal(size=(COUNT, velocities)),
        10.0 * rng.normal(size=(COUNT, rows)),
        length,
    )


def _jacobian(rng: np.random.Generator, dependence: str, rows: int, velocities: int) -> np.ndarray:
    jacobian = rng.normal(size=(COUNT, rows, velocities))
    half = rows // 2
    if dependence == "of rank two":
        jacobian = jacobian[..., :2] @ rng.normal(size=(COUNT, 2, velocities))
    elif dependence == "a row of zeros" and rows:
        jacobian[:, rng.integers(rows)] = 0.0
    elif dependence != "none" and half:
        jacobian[:, -half:] = jacobian[:, :half]
        if dependence == "nearly repeated":
            jacobian[:, -half:] *= 1.0 + 10.0 ** rng.uniform(-12, -3) * rng.normal(
                size=(COUNT, half, velocities)
            )
    return jacobian


def assert_finite(solution: Any) -> None:
    for name, value in solution._asdict().items():
        assert np.isfinite(value).all(), name


@pytest.mark.parametrize("dependence", DEPENDENCE)
def test_finite_input_has_a_finite_answer(dependence):
    rng = np.random.default_rng(DEPENDENCE.index(dependence))
    for _ in range(100):
        mass_matrix, bias, jacobian, acceleration, drift, length = problem(rng, dependence)
        law, priority = (mass_matrix, bias, jacobian, acceleration, drift), rng.uniform(-3, 3)
        assert_finite(orthogonal_inverse_dynamics(*law, base_priority=10.0**priority))
        limits = ContactLimits(rng.uniform(0.1, 1.2))
        assert_finite(
            limited_inverse_dynamics(*law, limits, base_priority=10.0**priority, length=length)
        )
        task = rng.normal(size=(COUNT, 6, jacobian.shape[2]))
        assert_finite(
            operational_space_acceleration(
                jacobian, drift, task, None, rng.normal(size=(COUNT, 6)), acceleration
            )
        )
