"""Robots that differ: in the simulation, in the controller's belief, and both from the MJCF."""

import copy

import mujoco
import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import PinocchioDynamics
from fbid_gym.dynamics.frames import quaternion_to_matrix
from fbid_gym.dynamics.stance import Stance
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.robots.built_in import asset_path
from fbid_gym.runtime.randomisation import Randomisation
from tests.batches import begun
from tests.pairs import pairs
from tests.robots.test_source_urdf import urdf

PLANT = {
    **{"mass": 0.3, "com": 0.02, "friction": (0.4, 0.8), "motor_strength": (0.7, 1.1)},
    "contact_time": (1.0, 2.5),
}
MODEL = {"model_mass": 0.2, "model_com": 0.01}
_VARIED = "body_mass body_inertia body_ipos geom_friction pair_friction actuator_gear".split()
_VARIED += "geom_solref pair_solref pair_solreffriction".split()


def build(name, randomisation, num_envs=6, **arguments):
    env = begun(name, num_envs, 3, randomisation=randomisation, **arguments)
    return env, env.chunks.batches[0]


@pytest.mark.parametrize("name", list(ENVIRONMENTS)[::3])
def test_off_by_default(name):
    assert not Randomisation().any
    plain, batch = build(name, None)
    empty, _ = build(name, {})
    for field in _VARIED:
        assert batch.simulation.batch.expanded(field) is None
    action = np.zeros(plain.action_space.shape)
    np.testing.assert_array_equal(plain.step(action)[0], empty.step(action)[0])


def test_a_payload_weighs_on_the_trunk_and_no_model_knows():
    load = {"payload": (0.25, 0.25)}
    for name in ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/HumanoidBalance-v0"):
        env, batch = build(name, load, num_envs=30)
        robot, physics = batch.robot, batch.simulation.batch
        base, nominal = robot.base_body, batch.simulation.model
        heavier = physics.expanded("body_mass") - nominal.body_mass
        np.testing.assert_allclose(heavier[:, base], 0.25 * robot.mass, rtol=1e-9)
        assert (np.delete(heavier, base, axis=1) == 0.0).all()
        # Where it lies, of the moments about the base's own centre of mass.
        moved = (physics.expanded("body_ipos") - nominal.body_ipos)[:, base]
        away = moved * physics.expanded("body_mass")[:, base, None] / (0.25 * robot.mass)
        upright = away @ quaternion_to_matrix(robot.home_qpos[None, 3:7])[0].T
        radius = Stance.of(robot).radius
        assert (np.abs(upright[:, :2]) <= 0.2 * radius + 1e-12).all()
        assert np.abs(upright[:, :2]).max() > 0.15 * radius
        np.testing.assert_allclose(upright[:, 2], 0.0, atol=1e-12)
        believed = batch.plant.terms().mass_matrix[:, 0, 0]
        np.testing.assert_allclose(believed, robot.mass, rtol=1e-9)
        env.close()


@pytest.mark.parametrize("name", list(ENVIRONMENTS)[::3])
def test_the_plant_differs_from_robot_to_robot_within_the_ranges(name):
    env, batch = build(name, PLANT, num_envs=40)
    nominal, physics = batch.robot.model, batch.simulation.batch
    moving = np.flatnonzero(nominal.body_rootid == batch.robot.base_body)
    mass = physics.expanded("body_mass")[:, moving] / nominal.body_mass[moving]
    assert 0.7 <= mass.min() < 0.72 and 1.28 < mass.max() <= 1.3
    inertia = physics.expanded("body_inertia")[:, moving] / nominal.body_inertia[moving]
    np.testing.assert_allclose(inertia, mass[:, :, None].repeat(3, axis=2))
    com = physics.expanded("body_ipos")[:, moving] - nominal.body_ipos[moving]
    assert 0.019 < np.abs(com).max() <= 0.02
    model = batch.simulation.model
    friction = physics.expanded("geom_friction") / model.geom_friction
    np.testing.assert_array_equal(friction[:, :, 1:], 1.0)
    assert (np.ptp(friction[:, :, 0], axis=1) < 1e-12).all()
    # Of pairs that are named, see `compile_paired`, sliding has two numbers.
    paired = physics.expanded("pair_friction") / model.pair_friction
    sliding = np.broadcast_to(friction[:, :1, :1], paired[:, :, :2].shape)
    np.testing.assert_allclose(paired[:, :, :2], sliding, rtol=1e-12)
    np.testing.assert_array_equal(paired[:, :, 2:], 1.0)
    assert 0.4 <= friction[..., 0].min() < 0.43 and 0.77 < friction[..., 0].max() <= 0.8
    times = physics.expanded("geom_solref") / model.geom_solref
    np.testing.assert_array_equal(times[:, :, 1], 1.0)
    assert (np.ptp(times[:, :, 0], axis=1) < 1e-12).all()
    assert 1.0 <= times[..., 0].min() < 1.25 and 2.2 < times[..., 0].max() <= 2.5
    strength = physics.expanded("actuator_gear")[..., 0] / nominal.actuator_gear[:, 0]
    assert strength.shape == (40, batch.robot.num_joints)
    assert 0.7 <= strength.min() < 0.71 and 1.09 < strength.max() <= 1.1
    # Every robot is its own, and the next episode's is another.
    assert len(np.unique(mass[:, 0])) == 40
    env.reset()
    again = physics.expanded("body_mass")[:, moving] / nominal.body_mass[moving]
    assert (again != mass).all()
    assert (nominal.body_mass == robots.load(batch.robot.name).model.body_mass).all()


def test_the_simulation_moves_like_a_robot_of_those_masses():
    """A robot of the batch against MuJoCo's step of a model that was changed by hand."""
    env, batch = build("fbid_gym/BipedBalance-v0", PLANT, action_layer="torque")
    physics, simulation = batch.simulation.batch, batch.simulation
    for index in range(3):
        model = copy.copy(simulation.model)
        model.opt.timestep = 1e-3
        for field in _VARIED:
            getattr(model, field)[:] = physics.expanded(field)[index]
        data = mujoco.MjData(model)
        mujoco.mj_setConst(model, data)
        data.qpos[:], data.qvel[:] = simulation.qpos[index], simulation.qvel[index]
        mujoco.mj_forward(model, data)
        qpos = []
        for _ in range(20):
            torque = np.minimum(batch.layer.hold, batch.robot.torque_limit)
            data.ctrl[batch.robot.actuator] = torque / batch.robot.gear
            mujoco.mj_step(model, data)
            qpos.append(data.qpos.copy())
        env.reset(seed=3)
        env.step(np.zeros(env.action_space.shape))
        np.testing.assert_allclose(simulation.qpos[index], qpos[-1], atol=1e-9)
        env.reset(seed=3)


def test_contacts_of_a_stiffness_and_a_damping_are_those_of_their_time_constant():
    text, feet = asset_path("go1.xml").read_text(), 'solref="0.008 1"'
    assert feet in text
    names, rested = [f"{foot.name}_foot" for foot in robots.load("go1").feet], []
    for given in (feet, f'solref="{-1.0 / 0.008**2!r} {-2.0 / 0.008!r}"'):
        robot = robots.Robot.from_mjcf(text.replace(feet, given), names)
        softer = {"contact_time": (2.0, 2.0)}
        env, batch = build("fbid_gym/QuadrupedBalance-v0", softer, num_envs=1, robot=robot)
        for _ in range(10):
            env.step(np.zeros(env.action_space.shape))
        rested.append(batch.simulation.qpos[0].copy())
        env.close()
    np.testing.assert_allclose(rested[1], rested[0], atol=1e-9)


@pytest.mark.parametrize("name", list(ENVIRONMENTS)[::3])
def test_the_controller_believes_in_a_model_of_its_own(name):
    """Its terms are those of the MJCF with the drawn factors, whatever the plant's are."""
    env, batch = build(name, PLANT | MODEL, num_envs=3, action_layer="base_acceleration")
    for _ in range(5):
        env.step(np.full(env.action_space.shape, 0.1))
    robot, simulation = batch.robot, batch.simulation
    drawn = {key.removeprefix("plant."): v for key, v in batch.state_dict().items()}
    believed, true = batch.plant.terms(), simulation.terms()
    moving = np.flatnonzero(robot.model.body_rootid == robot.base_body)
    names = [robot.model.body(int(body)).name for body in moving]
    for index in range(3):
        masses, shifts = drawn["model_mass"][index, moving], drawn["model_com"][index, moving]
        assert 0.8 <= masses.min() and masses.max() <= 1.2 and np.abs(shifts).max() <= 0.01
        mass, com = (dict(zip(names, values, strict=True)) for values in (masses, shifts))
        dynamics = PinocchioDynamics(robot, mass_scale=mass, com_offset=com)
        nominal = dynamics.terms(simulation.qpos[index][None], simulation.qvel[index][None])
        for field in nominal._fields:
            expected, ours = getattr(nominal, field)[0], getattr(believed, field)[index]
            scale = max(np.abs(expected).max(), 1e-3)
            assert np.abs(ours - expected).max() < 1e-9 * scale, field
        assert np.abs(believed.bias[index] - true.bias[index]).max() > 1e-3 * robot.weight
    # Where the robot is does not depend on what one believes of its masses.
    np.testing.assert_allclose(believed.foot_position, true.foot_position, atol=1e-12)
    np.testing.assert_allclose(believed.base_position, true.base_position, atol=1e-12)


def test_whole_robots_and_whole_models_are_wrong_by_as_much_as_said():
    """The terms are those of MuJoCo's model changed by hand; a fixed value is the same for all."""
    fixed = {"total_mass": 1.3, "model_total_mass": 0.8, "model_inertia": 1.5}
    ranges = {name: (value, value) for name, value in fixed.items()}
    ranges |= {"model_com_ahead": (0.02, 0.02)}
    env, batch = build("fbid_gym/BipedBalance-v0", ranges, num_envs=2)
    env.step(env.action_space.sample())
    robot, simulation = batch.robot, batch.simulation
    moving = np.flatnonzero(robot.model.body_rootid == robot.base_body)
    for field in ("body_mass", "body_inertia"):
        nominal = getattr(robot.model, field)[moving]
        plant = simulation.batch.expanded(field)[:, moving]
        np.testing.assert_allclose(plant, np.broadcast_to(1.3 * nominal, plant.shape))
    model = copy.copy(robot.model)
    model.body_mass[:] *= 0.8
    model.body_inertia[:] *= 0.8 * 1.5
    model.body_ipos[robot.base_body, 0] += 0.02
    data, believed = mujoco.MjData(model), batch.plant.terms()
    mujoco.mj_setConst(model, data)
    for index in range(2):
        data.qpos[:], data.qvel[:] = simulation.qpos[index], simulation.qvel[index]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(believed.com[index], data.subtree_com[robot.base_body])
        np.testing.assert_allclose(believed.bias[index], data.qfrc_bias, atol=1e-9)
        full = np.zeros((robot.nv, robot.nv))
        mujoco.mj_fullM(model, data, full)
        np.testing.assert_allclose(believed.mass_matrix[index], full, atol=1e-9)


def test_motors_give_their_share_of_what_is_commanded():
    """Within the limits and at them; what is reported is the command."""
    env, batch = build("fbid_gym/BipedBalance-v0", PLANT, action_layer="torque")
    strength = batch.state_dict()["plant.motor_strength"]
    given = batch.simulation.batch.bind("qfrc_actuator")
    for size in (0.2, 1.0):
        torque = env.step(np.full(env.action_space.shape, size))[4]["torque"]
        np.testing.assert_allclose(given[:, 6 : batch.robot.nv], strength * torque, rtol=1e-12)
    assert (np.abs(torque) == batch.robot.torque_limit).any()


def test_strong_motors_give_their_share_through_joints_of_limited_force():
    """Every joint of a URDF has such a limit."""
    strength = {"motor_strength": (1.2, 1.2)}
    own = {"robot": robots.Robot.from_mjcf(urdf(), home={}), "action_layer": "torque"}
    env, batch = build("fbid_gym/QuadrupedBalance-v0", strength, **own)
    assert batch.robot.model.jnt_actfrclimited[1:].all()
    given = batch.simulation.batch.bind("qfrc_actuator")
    torque = env.step(np.ones(env.action_space.shape))[4]["torque"]
    np.testing.assert_allclose(torque, np.broadcast_to(batch.robot.torque_limit, torque.shape))
    np.testing.assert_allclose(given[:, 6 : batch.robot.nv], 1.2 * torque, rtol=1e-12)


@pytest.mark.parametrize(
    ("ticks", "layer"), pairs([0, 1, 4, 5, 7, 10], ["torque", "joint_position"], 1)
)
def test_a_delayed_action_is_the_same_action_later(layer, ticks, rng):
    """Against a policy as fast as the control, which sends each action those ticks later."""
    name, seconds = "fbid_gym/QuadrupedWalk-v0", (ticks / 250, ticks / 250)
    steering = {"action_layer": layer, "layer_options": {"footholds": True}}
    late = begun(name, seed=4, **steering, randomisation={"action_delay": seconds})
    fast = begun(name, seed=4, **steering, policy_hz=250)
    actions = 0.2 * rng.uniform(-1.0, 1.0, (8, *late.action_space.shape)).astype(np.float32)
    sent = np.concatenate([np.zeros_like(actions[:1]).repeat(ticks, 0), actions.repeat(5, 0)])
    for step, action in enumerate(actions):
        late.step(action)
        for tick in range(5):
            fast.step(sent[5 * step + tick])
        for field in ("qpos", "qvel"):
            ours, theirs = (getattr(env.unwrapped.batch.simulation, field) for env in (late, fast))
            np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_delays_are_drawn_for_each_episode_and_begin_anew(rng):
    env, batch = build("fbid_gym/QuadrupedBalance-v0", {"action_delay": (0.01, 0.05)}, num_envs=40)
    first = batch.state_dict()
    assert (first["delay.ticks"] == np.round(500 * first["plant.action_delay"])).all()
    assert first["delay.ticks"].min() >= 5 and first["delay.ticks"].max() <= 25
    assert len(np.unique(first["delay.ticks"])) > 10
    env.step(rng.uniform(-1.0, 1.0, env.action_space.shape))
    assert batch.state_dict()["delay.action"].any()
    env.reset()
    again = batch.state_dict()
    assert not again["delay.action"].any()
    assert (again["delay.ticks"] != first["delay.ticks"]).any()


def test_a_wrong_model_changes_the_torques_of_model_based_layers_only():
    quiet = {"joint_noise": 0.0, "velocity_noise": 0.0, "push_force": (0, 0)}
    for layer, depends in (("base_acceleration", True), ("joint_position", False)):
        torques = []
        for randomisation in (None, MODEL):
            env, _ = build("fbid_gym/BipedBalance-v0", randomisation, action_layer=layer, **quiet)
            torques.append(np.abs(env.step(np.zeros(env.action_space.shape))[4]["torque"]))
        assert (np.abs(torques[0] - torques[1]).max() > 0.1) == depends
