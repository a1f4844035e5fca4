"""The torque goes on from where it was when the contacts switch, and ends where it shall."""

import numpy as np
import pytest

from fbid_gym.robots import ROBOTS
from tests.actions.cases import home_of, layer_of
from tests.pairs import pairs

RAMPED = ("joint_acceleration", "base_acceleration")
TICKS = 10


def sequence(layer, state, terms, reference, ticks):
    """Torques (T, N, n) at a state that stands still while time goes on."""
    memory, torques = layer.memory(len(state.qpos)), []
    action = np.zeros((len(state.qpos), len(layer.action_names)))
    for tick in range(ticks):
        now = state._replace(tick=state.tick + tick)
        torques.append(layer.torque(action, now, reference, lambda: terms, memory))
    return np.array(torques)


@pytest.mark.parametrize(
    ("robot", "name", "limits"),
    pairs(ROBOTS, pairs(RAMPED, ["friction", "none"])),
    indirect=["robot"],
)
def test_layers_lead_from_one_law_to_the_other(robot, states, name, limits):
    """What is added at a switch fades linearly, and no torque jumps.

    Each robot has its own time. The first contacts are no switch, whichever they are; another may
    come before a ramp is over, and the torque changes by what fades in a tick then as well.
    """
    feet = list(robot.foot_names)
    schedule = [(0.02, feet), (0.008, feet[1:]), (0.06, feet)]
    state, terms = states(4)
    state.tick[:] = 0, 3, 12, 30
    # Feet move at these states, for ever.
    home, options = home_of(robot, terms), {"contact_limits": limits, "notice_slip": False}
    jump, ramp = (
        sequence(layer_of(name, robot, contacts=schedule, **options, **own), state, terms, home, 60)
        for own in ({}, {"contact_ramp": TICKS / 500})
    )
    phase = (np.arange(60)[:, None] + state.tick) % 44
    lifted = (phase >= 10) & (phase < 14)
    added, left, amid, largest = np.zeros_like(jump[0]), np.zeros((4, 1)), 0, 0.0
    for tick in range(60):
        added, left = added - added / np.maximum(left, 1), np.maximum(left - 1, 0)
        switched = (lifted[tick] != lifted[max(tick - 1, 0)])[:, None]
        amid += (switched & (left > 0)).sum()
        added = np.where(switched, added + jump[tick - 1] - jump[tick], added)
        left = np.where(switched, TICKS, left)
        np.testing.assert_allclose(ramp[tick], jump[tick] + added, atol=1e-9 * robot.weight)
        over = left[:, 0] == 0
        np.testing.assert_array_equal(ramp[tick][over], jump[tick][over])
        largest = max(largest, np.abs(added).max())
    assert amid >= 4 and largest > 0.01 * robot.weight
