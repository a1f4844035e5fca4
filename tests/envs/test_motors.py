"""Motors of the simulation: laws of one joint, power, heat; and environments with them."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.envs.loop_delay import LoopDelay
from fbid_gym.envs.motors import MotorState, turn_motors
from fbid_gym.envs.tick import Wiring
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots.drives import Drives, TorqueLine
from fbid_gym.runtime.effort import Effort
from tests.batches import begun
from tests.envs.cases import MOTORS, WALK

DT, LIMIT, FULL, FREE = 1e-3, 8.0, 5.0, 20.0


class Joints:
    """N robots of n joints that only this module's motors turn; rows are [q', base', speeds, u]."""

    def __init__(self, num_robots: int = 1, num_joints: int = 1, **motors: Any) -> None:
        rows = np.zeros((num_robots, 6 + 2 * num_joints + 3))
        self.speed = rows[:, 6 : 6 + num_joints]
        ones = np.ones(num_joints)
        push = 6 + 2 * num_joints
        places = {"position": 0, "velocity": 0, "push": push, "contact": 0, "gear": 2.0 * ones}
        nothing = np.zeros((num_robots, 1)), np.zeros((num_robots, 1, 2), np.int32)
        controls = np.arange(6 + num_joints, push)
        self.wiring = Wiring(rows, *nothing, controls=controls, **places)
        given = {"full": FULL, "free": FREE, "lag": 0.0, "continuous": np.inf} | motors
        fading = ones / (given["free"] - given["full"])
        line = TorqueLine(LIMIT * ones, given["full"] * ones, fading)
        own = given["lag"] * ones, given["continuous"] * ones
        heat = given.get("thermal_time", 2.0), given.get("battery", np.inf)
        self.drives = Drives(line, *own, *heat, 0.0 * ones, 0.0 * ones)
        self.motors = MotorState.cold(num_robots, num_joints)
        self.effort = Effort.none(num_robots, num_joints)

    def turn(self, wanted: Any) -> np.ndarray:
        """Step the motors; the torques that the controls stand for."""
        asked = np.array(np.broadcast_to(wanted, self.speed.shape), float)
        push = np.zeros((len(asked), 3))
        own = self.wiring, self.drives, self.motors, self.effort
        turn_motors(*own, asked, push, DT, 1.0)
        controls = self.wiring.rows[:, self.wiring.controls] * self.wiring.gear
        np.testing.assert_allclose(controls, self.effort.torque, rtol=1e-14)
        return self.effort.torque.copy()


@pytest.mark.parametrize("load", [0.0, 2.0, 6.0])
def test_a_motor_under_load_settles_where_its_line_says(load: float) -> None:
    joints, inertia = Joints(), 0.02
    for _ in range(4000):
        joints.speed[:] += DT / inertia * (joints.turn(100.0) - load)
    np.testing.assert_allclose(joints.speed, FREE - load / LIMIT * (FREE - FULL), rtol=1e-6)


def test_a_motor_brakes_with_its_whole_torque_and_drives_nothing_beyond_no_load_speed() -> None:
    joints = Joints()
    joints.speed[:] = 2.0 * FREE
    assert joints.turn(LIMIT) == 0.0 and joints.turn(-2.0 * LIMIT) == -LIMIT
    joints.motors.speed[:] = 8.0
    assert joints.turn(LIMIT) == LIMIT


def test_lag_is_the_analytic_step_response_and_no_impulse_is_lost() -> None:
    lag = 3.7e-3
    joints = Joints(lag=lag)
    means = [float(joints.turn(LIMIT / 2)[0, 0]) for _ in range(12)]
    begin, end = DT * np.arange(12), DT * np.arange(1, 13)
    exact = 1.0 + lag / DT * (np.exp(-end / lag) - np.exp(-begin / lag))
    np.testing.assert_allclose(means, LIMIT / 2 * exact, rtol=1e-12)
    last = LIMIT / 2 * (1 - np.exp(-end[-1] / lag))
    np.testing.assert_allclose(joints.motors.torque, last, rtol=1e-12)


def test_a_battery_gives_no_more_than_its_power_and_shares_it(rng: np.random.Generator) -> None:
    plain, joints = (Joints(50, 6, full=90.0, free=99.0, battery=b) for b in (np.inf, 60.0))
    for one in (plain, joints):
        one.speed[:] = np.random.default_rng(3).normal(size=one.speed.shape) * 4.0
    wanted = rng.normal(size=plain.speed.shape) * LIMIT
    whole, given = plain.turn(wanted), joints.turn(wanted)
    power, asked = given * joints.speed, whole * plain.speed
    driving = np.maximum(asked, 0.0).sum(axis=1)
    assert (driving > 60.0).any() and (driving < 60.0).any()
    np.testing.assert_allclose(np.maximum(power, 0.0).sum(axis=1), np.minimum(driving, 60.0))
    share = np.minimum(1.0, 60.0 / np.maximum(driving, 1.0))[:, None]
    np.testing.assert_allclose(given, np.where(asked > 0.0, share, 1.0) * whole, rtol=1e-12)


def test_heat_is_bounded_and_lets_through_what_a_motor_bears_for_ever() -> None:
    joints = Joints(continuous=3.0, thermal_time=0.4)
    given = [float(joints.turn(LIMIT)[0, 0]) for _ in range(8000)]
    assert given[0] == LIMIT and joints.motors.heat.max() <= 1.0
    np.testing.assert_allclose(given[-1], 3.0, rtol=1e-6)
    # Up to there it took the time in which the heat of an exponential warming gets to 0.9.
    ticks = -0.4 * np.log(1.0 - 0.9 * (3.0 / LIMIT) ** 2) / DT
    assert abs(int(np.argmax(np.array(given) < LIMIT)) - ticks) <= 2
    cool = Joints(continuous=3.0, thermal_time=0.4)
    for _ in range(3000):
        assert cool.turn(2.9) == 2.9


def test_torques_act_their_delay_later_and_no_impulse_is_lost(rng: np.random.Generator) -> None:
    loop, hertz = LoopDelay(3, 2, 250, 0.01), 250
    loop.begin(np.arange(3), np.array([0.0, 0.008, 0.005]))
    made = rng.normal(size=(40, 3, 2))
    acted = np.array([loop.arriving(made[t], np.full(3, t)) for t in range(40)])
    np.testing.assert_array_equal(acted[:, 0], made[:, 0])
    np.testing.assert_array_equal(acted[2:, 1], made[:-2, 1])
    # 5 ms are a tick and a quarter of 4 ms: old for a quarter of the tick, new for the rest.
    np.testing.assert_allclose(acted[2:, 2], 0.75 * made[1:-1, 2] + 0.25 * made[:-2, 2])
    np.testing.assert_array_equal(acted[0], made[0])
    assert loop.most_ticks == int(np.ceil(0.01 * hertz))
    # What drives make themselves acts in the tick in which it is made.
    own = rng.normal(size=made.shape)
    again = LoopDelay(3, 2, 250, 0.01)
    again.begin(np.arange(3), np.array([0.0, 0.008, 0.005]))
    driven = [again.arriving(made[t] + own[t], np.full(3, t), own[t]) for t in range(40)]
    np.testing.assert_allclose(driven, acted + own, atol=1e-12)


def played(count: int, steps: int, **arguments: Any) -> tuple[Any, list[np.ndarray]]:
    envs = begun(WALK, count, 7, action_layer="base_acceleration", **arguments)
    still = np.zeros(envs.action_space.shape, np.float32)
    return envs, [envs.step(still)[0] for _ in range(steps)]


def test_motors_without_limits_of_their_own_are_ideal_to_the_bit() -> None:
    _, plain = played(2, 15)
    for arguments in ({"motors": {"thermal_time": 9.0}}, {"randomisation": {}}):
        np.testing.assert_array_equal(played(2, 15, **arguments)[1], plain)


def test_each_robot_has_its_own_motors_and_no_loop_is_later_than_said() -> None:
    envs, _ = played(3, 10, **MOTORS)
    motors = envs.chunks.batches[0].simulation.motors
    assert len(set(motors.speed)) == len(set(motors.lag)) == 3
    assert (motors.speed >= 0.7).all() and (motors.lag <= 2.0).all()
    saved = envs.chunks.state_dict()
    assert (saved["simulation.motor_heat"] > 0.0).any()
    saved["simulation.loop_ticks"] = saved["simulation.loop_ticks"] + 9.0
    with pytest.raises(InvalidValueError, match="loop_ticks"):
        envs.chunks.load_state_dict(saved)


def test_friction_is_the_tables_in_the_world_and_the_files_in_the_law() -> None:
    envs, _ = played(1, 1, motors={"dry_friction": 0.3, "viscous_friction": {"*_knee": 0.2}})
    batch = envs.chunks.batches[0]
    world, robot = batch.simulation.model, batch.robot
    np.testing.assert_array_equal(world.dof_frictionloss[6 : robot.nv], 0.3)
    knee = np.array([name.endswith("knee") for name in robot.joint_names])
    expected = np.where(knee, 0.2, robot.joint_damping)
    np.testing.assert_array_equal(world.dof_damping[6 : robot.nv], expected)
    assert (world.dof_damping[:6] == 0.0).all()
    assert not robot.model.dof_frictionloss.any()


@pytest.mark.parametrize("name", ["motor_speed", "motor_lag"])
def test_ideal_motors_have_nothing_that_could_vary(name: str) -> None:
    with pytest.raises(InvalidValueError, match=rf"randomisation {name}: \(0.8, 1.0\).*ideal"):
        gym.make(WALK, randomisation={name: (0.8, 1.0)})
