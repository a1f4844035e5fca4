"""The torque goes on from where it was when the contacts switch, and ends where it shall."""

import numpy as np
import pytest

from fbid_gym.actions import make_layer
from fbid_gym.actions.contact_ramp import ContactRamp
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.motions import home_reference
from fbid_gym.quantities import RobotState

RAMPED = ("joint_acceleration", "base_acceleration")
TICKS = 10


class Law:
    """Torques that depend on contacts and time alone, for three robots with two points."""

    def __init__(self, rng):
        self.table, self.asked = rng.normal(size=(3, 4, 2)), []

    def __call__(self, rows, contacts):
        self.asked.append(rows.tolist())
        return self.table[rows, contacts @ [1, 2]]

    def ramped(self, ramp, active, memory):
        torque = self.table[np.arange(3), active @ [1, 2]]
        return ramp.torque(torque, active, self, memory) - torque


def test_what_is_added_at_a_switch_fades_linearly(rng):
    ramp, law = ContactRamp(TICKS), Law(rng)
    memory = ramp.memory(3, 2, 2)
    both, left = np.ones((3, 2), bool), np.array([[True, True], [True, False], [True, True]])
    for _ in range(3):
        np.testing.assert_array_equal(law.ramped(ramp, both, memory), 0.0)
    for tick in range(2 * TICKS):
        added = law.ramped(ramp, left, memory)
        share = max(1.0 - tick / TICKS, 0.0)
        np.testing.assert_allclose(added[1], share * (law.table[1, 3] - law.table[1, 1]))
        np.testing.assert_array_equal(added[[0, 2]], 0.0)
    assert law.asked == [[1]]  # the old law is needed once, of the robot that switched


def test_the_first_contacts_are_no_switch(rng):
    """Nor are those of a robot that was reset."""
    ramp, law = ContactRamp(TICKS), Law(rng)
    memory = ramp.memory(3, 2, 2)
    for active in (np.zeros((3, 2), bool), np.ones((3, 2), bool)):
        for name, fresh in ramp.memory(3, 2, 2).items():
            memory[name][:] = fresh
        np.testing.assert_array_equal(law.ramped(ramp, active, memory), 0.0)
    assert law.asked == []


def test_switches_during_a_ramp_do_not_jump_either(rng):
    """Between ticks the torque changes by what fades, never by what switches."""
    ramp, law = ContactRamp(TICKS), Law(rng)
    memory = ramp.memory(3, 2, 2)
    largest = np.abs(law.table[:, :, None] - law.table[:, None]).max(axis=(1, 2))
    before = None
    for _ in range(400):
        active = rng.random((3, 2)) < 0.5
        torque = law.ramped(ramp, active, memory) + law.table[np.arange(3), active @ [1, 2]]
        if before is not None:
            # Within the torques that the contacts can ask for, and a tick's share of their spread.
            assert (np.abs(torque - before) <= largest / TICKS + 1e-12).all()
        before = torque


def sequence(layer, state, terms, reference, ticks):
    """Torques (T, N, n) at a state that stands still while time goes on."""
    memory, torques = layer.memory(len(state.qpos)), []
    action = np.zeros((len(state.qpos), len(layer.action_names)))
    for tick in range(ticks):
        now = state._replace(tick=state.tick + tick)
        torques.append(layer.torque(action, now, reference, lambda: terms, memory))
    return np.array(torques)


@pytest.mark.parametrize("name", RAMPED)
@pytest.mark.parametrize("limits", ["friction", "none"])
def test_layers_lead_from_one_law_to_the_other(robot, states, name, limits):
    """At the switch the torque of the old contacts, after the ramp that of the new ones."""
    feet = list(robot.foot_names)
    schedule = [(0.02, feet), (0.06, feet[1:])]
    state, terms = states(4)
    home, options = home_reference(robot), {"contact_limits": limits}
    torques = {}
    for key, extra in {
        "jump": {"contacts": schedule},
        "ramp": {"contacts": schedule, "contact_ramp": TICKS / 500},
        "old": {"contacts": [(1.0, feet)]},
    }.items():
        layer = make_layer(name, robot, 500, options | extra)
        torques[key] = sequence(layer, state, terms, home, 30)
    jump, ramp, old = torques["jump"], torques["ramp"], torques["old"]
    # Forces are solved to 1e-4 of the weight, from different warm starts.
    tolerance = robot.weight * {"friction": 5e-4, "none": 1e-9}[limits]
    np.testing.assert_allclose(ramp[:11], old[:11], atol=tolerance)
    np.testing.assert_array_equal(ramp[20:], jump[20:])
    step = np.abs(jump[10] - jump[9]).max()
    assert step > 0.01 * robot.weight
    assert np.abs(np.diff(ramp, axis=0)).max() < step / TICKS + 2 * tolerance
    assert np.abs(np.diff(ramp[11:21], axis=0)).max() > 0.9 * step / TICKS


@pytest.mark.parametrize("name", RAMPED)
def test_a_ramp_is_each_robots_own(robot, states, name):
    """Robots whose contacts switch at different ticks, together and one by one: the same bits."""
    feet = list(robot.foot_names)
    options = {"contacts": [(0.02, feet), (0.02, feet[1:])], "contact_ramp": 0.008}
    layer = make_layer(name, robot, 500, options)
    state, terms = states(8)
    state = state._replace(tick=3 * np.arange(8))
    home = home_reference(robot)
    together = sequence(layer, state, terms, home, 25)
    for row in (0, 5):
        part = slice(row, row + 1)
        one = RobotState(*(value[part] for value in state))
        alone = MuJoCoDynamics(robot).terms(one.qpos, one.qvel)
        np.testing.assert_array_equal(sequence(layer, one, alone, home, 25)[:, 0], together[:, row])
