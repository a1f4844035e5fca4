"""The torque goes on from where it was when the contacts switch, and ends where it shall."""

import numpy as np
import pytest

from fbid_gym.actions.contact_options import ContactRamp
from fbid_gym.robots import ROBOTS
from tests.actions.cases import home_of, layer_of
from tests.pairs import pairs

RAMPED = ("joint_acceleration", "base_acceleration")
TICKS = 10


class Law:
    """Torques that depend on contacts alone, for three robots with two points."""

    def __init__(self, rng):
        self.table = rng.normal(size=(3, 4, 2))
        self.ramp, self.size = ContactRamp(TICKS), np.abs(self.table).max()
        self.memory = self.ramp.memory(3, 2, 2)

    def torque(self, active):
        return self.table[np.arange(3), active @ [1, 2]]

    def added(self, active):
        """What the ramp adds."""
        torque = self.torque(active)
        return self.ramp.torque(torque, active, self.memory) - torque


def test_what_is_added_at_a_switch_fades_linearly(rng):
    law = Law(rng)
    both, left = np.ones((3, 2), bool), np.array([[True, True], [True, False], [True, True]])
    for _ in range(3):
        np.testing.assert_array_equal(law.added(both), 0.0)
    jump = law.torque(left) - law.torque(both)
    for tick in range(2 * TICKS):
        share = max(1.0 - tick / TICKS, 0.0)
        np.testing.assert_allclose(law.added(left), -share * jump, atol=1e-12)


def test_the_first_contacts_are_no_switch(rng):
    """Nor are those of a robot that was reset."""
    law = Law(rng)
    for active in (np.zeros((3, 2), bool), np.ones((3, 2), bool)):
        for name, fresh in law.ramp.memory(3, 2, 2).items():
            law.memory[name][:] = fresh
        np.testing.assert_array_equal(law.added(active), 0.0)


def test_switches_during_a_ramp_do_not_jump_either(rng):
    """At a switch the torque changes by what fades in a tick, as within a ramp."""
    law, active = Law(rng), np.ones((3, 2), bool)
    added = law.added(active)
    for _ in range(400):
        before, torque = active, law.torque(active) + added
        left, fading = law.memory["ramp_ticks"].copy(), added
        active = rng.random((3, 2)) < 0.5
        added = law.added(active)
        switched = (active != before).any(axis=1)
        change = (law.torque(active) + added - torque)[switched]
        expected = -(fading / np.maximum(left, 1)[:, None])[switched]
        np.testing.assert_allclose(change, expected, atol=1e-12)


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
    """At the switch the torque of the old contacts, after the ramp that of the new ones."""
    feet = list(robot.foot_names)
    schedule = [(0.02, feet), (0.06, feet[1:])]
    state, terms = states(4)
    # Feet move at these states, for ever.
    home, options = home_of(robot, terms), {"contact_limits": limits, "notice_slip": False}
    torques = {}
    cases = {"jump": {"contacts": schedule}, "old": {"contacts": [(1.0, feet)]}}
    cases["ramp"] = cases["jump"] | {"contact_ramp": TICKS / 500}
    for key, extra in cases.items():
        layer = layer_of(name, robot, **options, **extra)
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
