"""What a long run counts, and what it does not let pass."""

import gymnasium as gym
import numpy as np
import pytest

from eval.tools import soak
from eval.tools.soak import Reading, SoakConfig, Soaked, rows

WALK = "fbid_gym/QuadrupedWalk-v0"
HELD = Soaked("torque", 10, 50, 0, 1, Reading(100, 5, 2), Reading(100, 5, 2))


def test_steps_ticks_and_resets_are_counted():
    found = soak.soak(SoakConfig(WALK, ("torque",), steps=400, num_envs=4, num_threads=1), "torque")
    assert (found.steps, found.ticks, found.lost) == (400, 2000, 0)
    assert found.resets >= 8  # two seconds of four robots, if none falls before


def test_what_is_no_number_is_counted(monkeypatch):
    make = gym.make_vec

    def broken(*args, **kwargs):
        envs = make(*args, **kwargs)
        step = envs.step

        def one_lost(action):
            seen, *others = step(action)
            return np.where(np.arange(len(seen))[:, None] == 1, np.nan, seen), *others

        envs.step = one_lost
        return envs

    monkeypatch.setattr(gym, "make_vec", broken)
    config = SoakConfig(WALK, ("torque",), steps=100, num_envs=4, num_threads=1)
    assert soak.soak(config, "torque").lost == 25


@pytest.mark.parametrize(
    ("change", "held"),
    [
        ({}, True),
        ({"lost": 1}, False),
        ({"last": Reading(102, 5, 2)}, False),
        ({"last": Reading(100, 6, 2)}, False),
        ({"last": Reading(100, 5, 3)}, False),
        ({"last": Reading(90, 4, 1)}, True),
    ],
)
def test_growth_and_losses_are_not_let_pass(change, held):
    found = HELD._replace(**change)
    assert found.held is held
    assert ("(missed)" in rows([found])[-1]) is not held
