"""Laws that every robot obeys, whoever wrote its MJCF."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from fbid_gym.robots import ROBOTS, Robot, load
from fbid_gym.robots.built_in import GO1, asset_path
from tests.dynamics.models import GYMNASIUM, robot_called
from tests.postures import points, posed
from tests.robots.test_touching import BOX, FOOT, settled

CORNERS = {"a": (1, 1), "b": (1, -1), "c": (-1, 1), "d": (-1, -1), "middle": (0, 0)}
SITES = [f'<site name="{k}" pos="{0.1 * x} {0.06 * y} -0.02"/>' for k, (x, y) in CORNERS.items()]
BOX_FOOT = FOOT.format(vertices="0 0 0 1 0 0 0 1 0 0 0 1", shape="".join([BOX, *SITES]))


# Of an arm and a leg, of those who are built like people.
SHOULDER = {"shoulder_pitch", "shoulder_roll", "shoulder_yaw"}
LEG = {"hip_roll", "hip_pitch", "hip_yaw", "knee", "ankle_roll", "ankle_pitch"}


@pytest.fixture(params=[*ROBOTS, *GYMNASIUM])
def robot(request: pytest.FixtureRequest) -> Robot:
    return robot_called(request.param)


@pytest.fixture(params=ROBOTS)
def own(request: pytest.FixtureRequest) -> Robot:
    return load(request.param)


def ground_forces(robot: Robot, data: mujoco.MjData) -> np.ndarray:
    """(ngeom, 3) world-frame force on each geom, summed from the contacts one by one."""
    forces = np.zeros((robot.model.ngeom, 3))
    for i in range(data.ncon):
        wrench = np.empty(6)
        mujoco.mj_contactForce(robot.model, data, i, wrench)
        force = data.contact[i].frame.reshape(3, 3).T @ wrench[:3]  # on the second geom
        forces[data.contact[i].geom[1]] += force
        forces[data.contact[i].geom[0]] -= force
    return forces


def hold(
    robot: Robot,
    seconds: float,
    stiffness: np.ndarray | float,
    push: tuple[float, float, float] = (0, 0, 0),
) -> mujoco.MjData:
    """Joint PD about home at 500 Hz, with a constant force on the base."""
    data = posed(robot)
    data.xfrc_applied[robot.base_body, :3] = push
    for _ in range(int(seconds / robot.model.opt.timestep / 2)):
        error = robot.home_qpos[7:] - data.qpos[7:]
        torque = stiffness * error - 0.03 * stiffness * data.qvel[6:]
        torque = np.clip(torque, -robot.torque_limit, robot.torque_limit)
        data.ctrl[robot.actuator] = torque / robot.gear
        mujoco.mj_step(robot.model, data, nstep=2)
    mujoco.mj_forward(robot.model, data)
    return data


def standing_stiffness(robot: Robot) -> np.ndarray | float:
    """N m/rad, enough to stand; light arms and necks would shake with the legs'."""
    small = {"quadruped": (8.0, 8.0), "go1": (100.0, 100.0), "g1": (300.0, 30.0)}
    large = {"biped": (500.0, 500.0), "humanoid": (2000.0, 100.0)}
    legs, others = (small | large)[robot.name]
    carries = ("hip", "knee", "ankle", "waist_roll", "waist_pitch")
    return np.where([any(part in j for part in carries) for j in robot.joint_names], legs, others)


# What every robot promises.


def test_what_a_robot_says_of_itself(robot: Robot) -> None:
    n, model = robot.num_joints, robot.model
    assert (robot.nq, robot.nv) == (7 + n, 6 + n) == (model.nq, model.nv)
    assert robot.home_qpos.shape == (7 + n,) and robot.joint_range.shape == (n, 2)
    assert robot.contact_sensor.shape == (robot.num_points, 3)
    for array in (robot.torque_limit, robot.actuator, robot.gear, robot.joint_damping):
        assert array.shape == (n,)
    assert [model.joint(name).dofadr[0] for name in robot.joint_names] == [*range(6, 6 + n)]
    assert robot.num_points == sum(len(foot.point_names) for foot in robot.feet)
    assert robot.foot_names == tuple(foot.name for foot in robot.feet)
    assert robot.mass == pytest.approx(model.body_mass[1:].sum())
    assert robot.weight == pytest.approx(9.81 * robot.mass)
    assert (model.body_weldid[model.geom_bodyid] == 0).sum() == 1  # one ground
    # It stands on it, within the ranges of its joints.
    assert points(robot, posed(robot))[:, 2].min() == pytest.approx(0, abs=1e-12)
    low, high = robot.joint_range.T
    assert ((low <= robot.home_qpos[7:]) & (robot.home_qpos[7:] <= high)).all()
    assert np.linalg.norm(robot.home_qpos[3:7]) == pytest.approx(1.0)
    for array in (robot.home_qpos, robot.torque_limit, robot.feet[0].points):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


def test_ctrl_gives_the_torque_of_the_joint(robot: Robot, rng: np.random.Generator) -> None:
    torque = rng.uniform(-1, 1, robot.num_joints) * robot.torque_limit
    data = posed(robot)
    data.ctrl[robot.actuator] = torque / robot.gear
    mujoco.mj_forward(robot.model, data)
    np.testing.assert_allclose(data.qfrc_actuator[6:], torque)
    data.ctrl[robot.actuator] = 2 * robot.torque_limit / robot.gear
    mujoco.mj_forward(robot.model, data)
    np.testing.assert_allclose(data.qfrc_actuator[6:], robot.torque_limit)


def test_sensors_hold_the_force_on_each_point(robot: Robot) -> None:
    """Against the contacts themselves, moving, one side pressed deeper than the other."""
    data = posed(robot)
    data.qpos[2] -= 0.002
    data.qpos[3:7] = np.array([1.0, 0.01, 0.02, 0.0]) / np.linalg.norm([1.0, 0.01, 0.02, 0.0])
    data.qvel[:] = 0.1
    mujoco.mj_forward(robot.model, data)
    forces = ground_forces(robot, data)
    names = [name for foot in robot.feet for name in foot.point_names]
    expected = np.array([forces[robot.model.geom(name).id] for name in names])
    assert np.count_nonzero(expected[:, 2] > 0) >= 1
    np.testing.assert_allclose(data.sensordata[robot.contact_sensor], expected, atol=1e-9)


@pytest.mark.parametrize(
    ("scenery", "known"),
    [
        ('<geom type="box" size="1 0.1 1" pos="0 3 0"/>', False),  # a wall
        ('<geom type="box" size="2 2 0.1" pos="0 0 3"/>', False),  # a ceiling
        ('<geom type="box" size="2 2 0.1" pos="0 0 -0.1"/>', True),  # a floor
        ('<geom type="box" size="2 2 0.1" pos="0 0 -0.1" rgba="1 1 1 0"/>', True),
        ('<geom type="box" size="2 2 0.1" pos="0 0 -0.1" contype="0" conaffinity="0"/>', False),
        ('<geom type="box" size="2 2 0.1" pos="0 0 -0.1" contype="2" conaffinity="2"/>', False),
        ('<geom type="plane" size="2 2 0.1" pos="3 0 0"/>', True),  # is drawn elsewhere
        ('<body mocap="true"><geom type="box" size="2 2 0.1" pos="0 0 -0.1"/></body>', True),
        ('<geom type="cylinder" size="0.05 0.01" pos="0 0 0"/>', False),  # between the feet
    ],
)
def test_ground_is_what_lies_below_the_robot(scenery: str, known: bool) -> None:
    text = Path(asset_path("go1.xml")).read_text().replace("<worldbody>", f"<worldbody>{scenery}")
    robot = Robot.from_mjcf(text, GO1.feet, home=GO1.home)
    static = robot.model.body_weldid[robot.model.geom_bodyid] == 0
    names = [robot.model.geom(geom).name for geom in np.flatnonzero(static)]
    assert ("fbid_ground" in names) != known
    assert not any("ground" in line for line in robot.check())


def test_a_ground_elsewhere_is_told() -> None:
    for height, told in ((-1.0, "1e+03 mm below"), (0.1, "100 mm above")):
        floor = f'<geom type="plane" size="2 2 0.1" pos="0 0 {height}"/>'
        text = asset_path("go1.xml").read_text().replace("<worldbody>", f"<worldbody>{floor}")
        robot = Robot.from_mjcf(text, GO1.feet, home=GO1.home)
        (line,) = (line for line in robot.check() if line.startswith("The file's ground is"))
        assert line == f"The file's ground is {told} the feet at home, which begin at z = 0."


# Our own.


def test_what_is_written_out_can_be_read_back(robot: Robot) -> None:
    feet = {foot.name: foot.point_names for foot in robot.feet}
    home = dict(zip(robot.joint_names, robot.home_qpos[7:].tolist(), strict=True))
    for source in (robot.spec.to_xml(), robot.spec.copy()):
        again = Robot.from_mjcf(source, feet, home=home)
        assert again.model.nsensor == robot.model.nsensor and again.model.nsite == robot.model.nsite
        assert again.model.ngeom == robot.model.ngeom
        np.testing.assert_allclose(again.home_qpos, robot.home_qpos, atol=1e-5)
        np.testing.assert_allclose(again.torque_limit, robot.torque_limit, rtol=1e-5)


@pytest.mark.parametrize(
    "name, mass, joints",
    [
        ("biped", 55.52, 16),
        ("quadruped", 2.7464, 12),
        ("humanoid", 77.483, 27),
        ("go1", 12.7436, 12),
        ("g1", 33.34, 29),
    ],
)
def test_size_of_the_robot(name: str, mass: float, joints: int) -> None:
    robot = load(name)
    assert robot.mass == pytest.approx(mass)
    assert robot.num_joints == joints


def test_biped_follows_the_paper() -> None:
    """[M10] IV.A: 2 x 7-DoF legs, 1 x 2-DoF torso, four points a foot, knees that extend fully."""
    robot = load("biped")
    for side in ("left", "right"):
        assert sum(name.startswith(side) for name in robot.joint_names) == 7
        knee = robot.joint_names.index(f"{side}_knee")
        assert robot.joint_range[knee, 0] == 0.0
        assert robot.home_qpos[7 + knee] > 0.3
    assert sum(name.startswith("torso") for name in robot.joint_names) == 2
    assert [foot.num_points for foot in robot.feet] == [4, 4]


def test_quadruped_is_as_large_as_littledog() -> None:
    robot = load("quadruped")
    data = posed(robot)
    solid = np.flatnonzero(robot.model.geom_bodyid > 0)
    radius = robot.model.geom_rbound[solid]
    assert data.geom_xpos[solid, 2].max() == pytest.approx(0.20, abs=0.01)
    length = np.max(data.geom_xpos[solid, 0]) - np.min(data.geom_xpos[solid, 0])
    assert 0.25 < length < length + 2 * radius.min() < 0.32


def test_humanoid_follows_the_paper() -> None:
    """[G15] V: 27 degrees of freedom, 1.7 m, about 77.5 kg, TORO's legs, arms, waist and neck."""
    robot = load("humanoid")
    assert robot.mass == pytest.approx(77.5, abs=0.05)
    limbs = LEG | SHOULDER | {"elbow", "forearm_yaw", "wrist_roll"}
    both = {f"{side}_{joint}" for side in ("left", "right") for joint in limbs}
    assert set(robot.joint_names) == both | {"waist_yaw", "neck_yaw", "neck_pitch"}
    assert [foot.num_points for foot in robot.feet] == [4, 4]
    for foot in robot.feet:
        np.testing.assert_allclose(np.ptp(foot.points, axis=0), [0.19, 0.095, 0.0], atol=1e-12)
    data = posed(robot)
    top = data.geom_xpos[:, 2] + robot.model.geom_rbound * (robot.model.geom_bodyid > 0)
    assert top.max() == pytest.approx(1.7, abs=0.02)
    assert data.body("left_upper_thigh").xpos[2] == pytest.approx(0.87, abs=0.01)  # the hip
    assert 0.93 < data.subtree_com[robot.base_body][2] < 0.98


def test_go1_is_as_large_as_published() -> None:
    """Twelve joints, legs of 0.213 + 0.213 m beside hips 0.376 m and 0.0935 m apart."""
    robot = load("go1")
    data = posed(robot)
    hips = np.array([data.body(f"{leg}_hip").xpos for leg in robot.foot_names])
    np.testing.assert_allclose(np.ptp(hips, axis=0), [0.3762, 0.0935, 0.0], atol=1e-12)
    assert hips[0, 2] == pytest.approx(0.29, abs=1e-3)
    for leg in robot.foot_names:
        upper, lower = data.body(f"{leg}_upper_leg").xpos, data.body(f"{leg}_lower_leg").xpos
        foot = data.geom(f"{leg}_foot").xpos
        assert np.linalg.norm(lower - upper) == pytest.approx(0.213)
        assert np.linalg.norm(foot - lower) == pytest.approx(0.213)
    limit = dict(zip(robot.joint_names, robot.torque_limit, strict=True))
    assert {limit[name] for name in limit if "knee" in name} == {35.55}
    assert {limit[name] for name in limit if "hip" in name} == {23.7}


def test_g1_is_as_large_as_published() -> None:
    """29 joints: six a leg, three in the waist, seven an arm; 1.3 m with straight legs."""
    robot = load("g1")
    limbs = LEG | SHOULDER | {"elbow", "wrist_roll", "wrist_pitch", "wrist_yaw"}
    both = {f"{side}_{joint}" for side in ("left", "right") for joint in limbs}
    assert set(robot.joint_names) == both | {"waist_yaw", "waist_roll", "waist_pitch"}
    assert [foot.num_points for foot in robot.feet] == [4, 4]
    data = posed(robot, robot.model.qpos0)
    solid = robot.model.geom_bodyid > 0
    top = np.max((data.geom_xpos[:, 2] + robot.model.geom_rbound)[solid])
    assert top - points(robot, data)[:, 2].min() == pytest.approx(1.32, abs=0.02)
    hip, knee, ankle = (data.body(f"left_{link}").xpos for link in ("hip", "shank", "ankle"))
    # The axes of hip pitch, knee and ankle, seen from the side.
    assert np.linalg.norm((hip - knee)[[0, 2]]) == pytest.approx(0.337, abs=1e-3)
    assert np.linalg.norm((knee - ankle)[[0, 2]]) == pytest.approx(0.3, abs=1e-3)


def test_built_in_robots_are_physical_and_stand_over_the_centre_of_their_feet(own: Robot) -> None:
    data = posed(own)
    touching = points(own, data)
    np.testing.assert_allclose(touching[:, 2], 0.0, atol=1e-12)
    offset = data.subtree_com[own.base_body] - touching.mean(axis=0)
    np.testing.assert_allclose(offset[:2], 0.0, atol=1e-3)
    moments = np.sort(own.model.body_inertia[1:], axis=1)
    assert np.all(own.model.body_mass[1:] > 0) and np.all(moments > 0)
    assert np.all(moments[:, 0] + moments[:, 1] > moments[:, 2])
    assert np.all(own.model.dof_armature[6:] > 0) and np.all(own.model.dof_armature[:6] == 0)
    assert np.all(own.joint_damping > 0) and np.all(own.gear == 1.0)
    assert np.all(np.isfinite(own.joint_range))


def test_home_can_be_held(own: Robot) -> None:
    """Plain PD comes to rest; the sensors weigh the robot; the ground hardly gives."""
    data = hold(own, 6.0, standing_stiffness(own))
    forces = data.sensordata[own.contact_sensor]
    np.testing.assert_allclose(forces.sum(axis=0), [0, 0, own.weight], atol=1e-3 * own.weight)
    assert np.all(forces[:, 2] > 0.5 * own.weight / own.num_points)
    assert np.abs(data.qvel).max() < 0.01
    assert np.all(np.abs(data.qfrc_actuator[6:]) < 0.3 * own.torque_limit)
    assert -1e-3 < data.contact.dist.min() < 0
    assert data.ncon == own.num_points


def test_feet_do_not_creep_under_a_steady_push(own: Robot) -> None:
    push = (0.05 * own.weight, 0.0, 0.0)
    early = hold(own, 1.0, 2 * standing_stiffness(own), push)
    late = hold(own, 6.0, 2 * standing_stiffness(own), push)
    forces = late.sensordata[own.contact_sensor]
    np.testing.assert_allclose(forces.sum(axis=0)[0], -push[0], rtol=0.05)
    for foot in own.feet:
        moved = late.xpos[foot.body] - early.xpos[foot.body]
        np.testing.assert_allclose(moved[:2], 0.0, atol=2e-3)


def test_a_fallen_robot_lies_on_the_floor(own: Robot) -> None:
    data = posed(own)
    data.qvel[:3] = [2.0, 0.5, 0.0]
    mujoco.mj_step(own.model, data, nstep=3000)
    assert np.all(np.isfinite(data.qpos))
    assert data.xpos[1:, 2].min() > -0.01
    assert np.abs(data.qvel).max() < 1.0
    geoms = data.contact.geom
    assert np.all(own.model.geom_bodyid[geoms].min(axis=1) == 0)  # links never touch each other


# Ways of naming feet and home, and the files that gymnasium ships.


def test_robots_of_gymnasium() -> None:
    robot, ant = map(robot_called, GYMNASIUM)
    assert (robot.name, robot.num_joints, robot.num_points) == ("humanoid", 17, 2)
    limit = dict(zip(robot.joint_names, robot.torque_limit, strict=True))
    assert limit["right_hip_y"] == pytest.approx(0.4 * 300) and robot.feet[0].radius == 0.075
    ends = [[0.4, 0.4, 0], [-0.4, 0.4, 0], [-0.4, -0.4, 0], [0.4, -0.4, 0]]
    np.testing.assert_allclose([foot.points[0] for foot in ant.feet], ends, atol=1e-9)
    assert ant.feet[0].radius == 0.08


@pytest.mark.parametrize("names", [["a", "b", "c", "d"], ["middle"], ["d", "a"], ["a", "b"]])
def test_sites_on_a_box_foot(names: list[str]) -> None:
    """The named sites carry the whole foot between them, and corners each their own."""
    robot = Robot.from_mjcf(BOX_FOOT, {"foot": names})
    data = settled(robot, 1000)
    forces = data.sensordata[robot.contact_sensor]
    total = ground_forces(robot, data)[robot.model.geom_bodyid == robot.feet[0].body].sum(axis=0)
    assert np.all(forces[:, 2] > 0)
    np.testing.assert_allclose(forces.sum(axis=0), total, atol=1e-9)
    np.testing.assert_allclose(forces.sum(axis=0)[2], robot.weight, rtol=1e-3)
    if len(names) == 4:
        corners = data.xpos[robot.feet[0].body] + robot.feet[0].points
        for corner, force in zip(corners, forces, strict=True):
            (near,) = np.flatnonzero(np.linalg.norm(data.contact.pos - corner, axis=1) < 0.02)
            wrench = np.empty(6)
            mujoco.mj_contactForce(robot.model, data, int(near), wrench)
            assert force[2] == pytest.approx(wrench[0])


def test_home_as_mapping_vector_and_keyframe() -> None:
    key = '<keyframe><key name="{}" qpos="0 0 9 2 0 0 0 0.05"/></keyframe></mujoco>'
    text, feet = BOX_FOOT.replace("</mujoco>", key.format("low")), {"foot": ["middle"]}
    plain = Robot.from_mjcf(text, feet)
    assert plain.home_qpos[7] == 0.0
    assert plain.home_qpos[2] == pytest.approx(0.32)
    mapping = Robot.from_mjcf(text, feet, home={"slide": 0.05})
    vector = Robot.from_mjcf(text, feet, home=[0, 0, 3, 1, 0, 0, 0, 0.05])
    keyframe = Robot.from_mjcf(text, feet, home="low")
    for robot in (mapping, vector, keyframe):
        np.testing.assert_allclose(robot.home_qpos, [0, 0, 0.27, 1, 0, 0, 0, 0.05], atol=1e-12)
    usual = BOX_FOOT.replace("</mujoco>", key.format("home"))
    np.testing.assert_allclose(Robot.from_mjcf(usual, feet).home_qpos, keyframe.home_qpos)


@pytest.mark.parametrize(
    "motor, joint, limit",
    [
        ('ctrlrange="-60 60"', "", 60.0),
        ('ctrlrange="-6 6" gear="-10"', "", 60.0),
        ('ctrlrange="-40 60"', "", 40.0),
        ('ctrlrange="-6 6" gear="10" forcerange="-5 5"', "", 50.0),
        ('gear="10" forcerange="-5 5"', "", 50.0),
        ('ctrlrange="-60 60"', 'actuatorfrcrange="-30 35"', 30.0),
    ],
)
def test_torque_limit_is_what_the_motor_can_give_both_ways(motor, joint, limit):
    text = BOX_FOOT.replace('ctrlrange="-60 60"', motor)
    text = text.replace('range="-0.1 0.1"', f'range="-0.1 0.1" {joint}')
    robot = Robot.from_mjcf(text, {"foot": ["middle"]})
    assert robot.torque_limit[0] == pytest.approx(limit)
    data = posed(robot)
    for sign in (1.0, -1.0):
        data.ctrl[0] = sign * limit / robot.gear[0]
        mujoco.mj_forward(robot.model, data)
        assert data.qfrc_actuator[6] == pytest.approx(sign * limit)
