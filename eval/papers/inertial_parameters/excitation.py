"""Find the inertial parameters that motion data identify.

No motion tells all of them: only the combinations on which the dynamics depend, the *base
parameters*. A given motion tells fewer, as flat feet that never leave the ground do not tell their
own mass, and contacts hide what only the contact forces see.

Directions are measured in the nominal model's own metric, in which a unit step is a change of a
body's mass distribution by its own size (see `natural_steps`). It does not depend on units, nor on
the body frames.
"""

from typing import NamedTuple

import numpy as np

from eval.papers.inertial_parameters.inertia import (
    PARAMETERS,
    parameters_of_pseudo_inertia,
    pseudo_inertia,
)
from eval.papers.inertial_parameters.regressor import InertialRegressor

RESOLUTION = 1e-5
"""Share of the torque that the data are taken to resolve. Noise cannot be told from motion: with
noisy data, it is more."""

_TOLD, _UNTOLD = 0.01, 0.99
_NUM_STATES = 40
_BASE_RTOL = 1e-9


def _symmetric_basis() -> np.ndarray:
    """Orthonormal basis (10, 4, 4) of the symmetric matrices."""
    basis = np.zeros((10, 4, 4))
    for element, (row, column) in zip(basis, zip(*np.triu_indices(4), strict=True), strict=True):
        element[row, column] = element[column, row] = 1.0 if row == column else np.sqrt(0.5)
    return basis


BASIS = _symmetric_basis()
"""(10, 4, 4) orthonormal symmetric matrices E_k, in which changes of a body are written."""


def natural_steps(nominal: np.ndarray) -> np.ndarray:
    """Changes of the parameters that are steps of unit size for the bodies as they are.

    A body with pseudo-inertia P0 = L L^T becomes L (1 + E_k) L^T.

    Args:
        nominal: (B, 10) parameters of bodies that can exist.

    Returns:
        (B, 10, 10), step k in column k.
    """
    root = np.linalg.cholesky(pseudo_inertia(nominal))[:, None]
    return parameters_of_pseudo_inertia(root @ BASIS @ root.mT).mT


class Excitation(NamedTuple):
    """Identifiability of p = 10 B parameters of B bodies. Names are "body parameter"."""

    singular_values: np.ndarray
    """(p,) what a unit step in each singular direction does to the projected torques, relative to
    their root mean square; falling."""
    dimension: int  # how many of them exceed the resolution: combinations that the data tell
    attainable: int  # base parameters, the combinations that motion in the air could tell
    condition: float  # ratio of the first to the last singular value that counts
    open_share: np.ndarray
    """(B, 10) how much of each parameter by itself the data leave open: 0 if they tell it alone, 1
    if they tell nothing about it."""
    told: tuple[str, ...]  # parameters that the data tell by themselves
    combined: tuple[str, ...]  # those that they tell in combinations with others only
    untold: tuple[str, ...]  # those about which they tell nothing: they stay nominal


def excitation_of(
    regressor: InertialRegressor, steps: np.ndarray, effect: np.ndarray
) -> Excitation:
    """Judge data by what natural steps (B, 10, 10) do to them.

    Args:
        regressor: of the nominal robot.
        steps: its natural steps.
        effect: (r, 10 B) of each on the data, in units of the norm of the data.
    """
    _, sizes, directions = np.linalg.svd(effect)
    sizes = np.concatenate([sizes, np.zeros(len(directions) - len(sizes))])
    dimension = int((sizes > RESOLUTION).sum())
    # Each parameter as a combination of steps, and how much of it lies in what the data leave open.
    blind = directions[dimension:].reshape(-1, len(steps), 10)
    seen_as = np.linalg.norm(np.einsum("bik,rbk->bir", steps, blind), axis=2)
    open_share = np.minimum(seen_as / np.linalg.norm(steps, axis=2), 1.0)
    names = np.array([[f"{body} {name}" for name in PARAMETERS] for body in regressor.names])
    told, untold = open_share < _TOLD, open_share > _UNTOLD
    named = (tuple(names[which].tolist()) for which in (told, ~told & ~untold, untold))
    condition = float(sizes[0] / sizes[dimension - 1]) if dimension else np.nan
    attainable = base_dimension(regressor, steps)
    return Excitation(sizes, dimension, attainable, condition, open_share, *named)


def base_dimension(regressor: InertialRegressor, steps: np.ndarray) -> int:
    """Number of base parameters: combinations of parameters on which the dynamics depend."""
    robot, rng = regressor.robot, np.random.default_rng(0)
    qpos = rng.normal(size=(_NUM_STATES, robot.nq))
    qvel, qacc = 3.0 * rng.normal(size=(2, _NUM_STATES, robot.nv))
    rows = regressor.rows(qpos, qvel, 3.0 * qacc).reshape(-1, regressor.num_parameters)
    sizes = np.linalg.svd(by_steps(rows, steps), compute_uv=False)
    return int((sizes > _BASE_RTOL * sizes[0]).sum())


def by_steps(rows: np.ndarray, steps: np.ndarray) -> np.ndarray:
    """Effect (r, 10 B) of natural steps (B, 10, 10), from that of the parameters, (r, 10 B)."""
    by_body = rows.reshape(len(rows), len(steps), 1, 10)
    return (by_body @ steps)[:, :, 0].reshape(rows.shape)
