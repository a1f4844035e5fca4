"""The centroidal terms of one robot are refused for another's.

Momentum and matrix against Pinocchio's, and the propositions of [G15], are in
`tests/eval/papers/garofalo2015/test_decoupled_dynamics.py`.
"""

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics, centroidal_terms
from fbid_gym.errors import ShapeError


def test_what_belongs_to_other_robots_is_refused():
    robot = robots.load("quadruped")
    velocity = np.zeros((4, robot.nv))
    terms = MuJoCoDynamics(robot).terms(np.tile(robot.home_qpos, (4, 1)), velocity)
    for name in ("mass_matrix", "base_position", "world_from_base", "com"):
        one_robots = terms._replace(**{name: getattr(terms, name)[:1]})
        with pytest.raises(ShapeError, match=f"{name} has shape .* Expected"):
            centroidal_terms(one_robots, velocity)
    for wrong in (velocity[0], velocity[:, :5], velocity[:2]):
        with pytest.raises(ShapeError, match="has shape .* Expected"):
            centroidal_terms(terms, wrong)
