"""Files of strangers that MuJoCo, or the laws, cannot take as they are: set right, or refused."""

import re
from pathlib import Path

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import RobotError
from fbid_gym.robots import Robot, load, zoo
from fbid_gym.robots.portrait import portrait
from fbid_gym.robots.terrain.obstacles import random_obstacles
from fbid_gym.robots.terrain.rocks import random_rocks
from tests.postures import posed
from tests.robots.test_source_urdf import LEGS, MESH, urdf
from tests.robots.test_touching import FOOT


def noted(robot: Robot, words: str) -> bool:
    return any(words in note for note in robot.notes)


def dog(extra: str = "", base: str = '<link name="base"/>') -> str:
    """A URDF of four legs, with more in it."""
    return urdf().replace('<link name="base"/>', base, 1).replace("</robot>", extra + "</robot>")


LIMIT = '<limit effort="1" velocity="1" lower="-1" upper="1"/>'


def degrees(radians: str) -> float:
    return float(np.degrees(float(radians)))


def hinge(name: str, parent: str, child: str, limit: str = LIMIT, kind: str = "revolute") -> str:
    return f"""<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
      <axis xyz="0 0 1"/><origin xyz="0 0 0.1"/>{limit}</joint>"""


def link(name: str, mass: float = 0.1, moment: float = 1e-4, cross: float = 0.0) -> str:
    return f"""<link name="{name}"><inertial><mass value="{mass}"/><inertia ixx="{moment}"
      iyy="{moment}" izz="{moment}" ixy="{cross}" ixz="0" iyz="0"/></inertial></link>"""


@pytest.mark.parametrize(
    "inertia", [dict(mass=0.0, moment=0.0), dict(moment=1e-4, cross=2e-4), dict(moment=0.0)]
)
def test_inertias_that_no_body_has_are_mended(inertia: dict[str, float]) -> None:
    robot = Robot.from_mjcf(dog(link("lidar", **inertia) + hinge("lidar", "trunk", "lidar")))
    assert noted(robot, "Masses and inertias that no body has")
    assert robot.mass == pytest.approx(Robot.from_mjcf(urdf()).mass, abs=0.11)
    assert np.linalg.eigvalsh(mass_matrix(robot)).min() > 0.0
    again = robot.portable()
    assert again.digest == robot.portable().digest and again.mass == pytest.approx(robot.mass)


def test_a_link_without_an_inertia_weighs_nothing() -> None:
    """Whatever the shape that it touches with."""
    box = '<collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision>'
    pack = f'<link name="pack">{box}</link>'
    fixed = '<joint name="pack" type="fixed"><parent link="trunk"/><child link="pack"/></joint>'
    robot = Robot.from_mjcf(dog(pack + fixed))
    assert noted(robot, "Links without an inertia weigh nothing: pack.")
    assert robot.mass == pytest.approx(Robot.from_mjcf(urdf()).mass, rel=1e-5)
    root = urdf().replace('<link name="trunk">', f'<link name="trunk">{box}', 1)
    bare = re.sub(r'(<link name="trunk">.*?)<inertial>.*?</inertial>', r"\1", root, flags=re.DOTALL)
    assert bare != root
    legs = Robot.from_mjcf(bare)
    assert legs.mass < Robot.from_mjcf(urdf()).mass and noted(legs, "weigh nothing: trunk")


def mass_matrix(robot: Robot) -> np.ndarray:
    data = posed(robot)
    mass = np.empty((robot.nv, robot.nv))
    mujoco.mj_fullM(robot.model, data, mass)
    return mass


@pytest.mark.parametrize("angle", [0.0, 0.7])
def test_equal_limits_lock_a_joint_where_they_are(angle: float) -> None:
    arm = link("arm", 0.5) + link("hand")
    limit = f'<limit effort="1" velocity="1" lower="{angle}" upper="{angle}"/>'
    fixed = '<joint name="wrist" type="fixed"><parent link="arm"/><child link="hand"/>'
    fixed += '<origin xyz="0.3 0 0"/></joint>'
    robot = Robot.from_mjcf(dog(arm + fixed + hinge("lock", "trunk", "arm", limit)))
    assert robot.num_joints == 8 and noted(robot, "Joints locked, whose limits are equal: lock.")
    data = robot.at_home.data
    place = data.body("hand").xpos - data.body("arm").xpos
    np.testing.assert_allclose(place, [0.3 * np.cos(angle), 0.3 * np.sin(angle), 0.0], atol=1e-9)


@pytest.mark.parametrize("compiler, angle", [("degree", 40.0), ("radian", np.radians(40.0))])
def test_equal_limits_of_an_mjcf_lock_a_joint_too(compiler: str, angle: float) -> None:
    """Measured from its reference, in the units of the file."""
    arm = f"""<body name="arm"><joint name="lock" axis="0 0 1" ref="{angle / 4}"
      range="{angle} {angle}"/><geom size="0.01"/>
      <body name="hand" pos="0.3 0 0"><geom size="0.01"/></body></body>"""
    own = zoo.mjcf(zoo.draw(37))  # with motors
    if compiler == "degree":
        own = own.replace('angle="radian"', "")
        ends = re.compile(r'(<joint name="leg[^>]* )range="(\S+) (\S+)"')
        own = ends.sub(lambda m: f'{m[1]}range="{degrees(m[2])} {degrees(m[3])}"', own)
    robot = Robot.from_mjcf(own.replace("<freejoint/>", "<freejoint/>" + arm, 1))
    plain = Robot.from_mjcf(zoo.mjcf(zoo.draw(37)))
    np.testing.assert_allclose(robot.joint_range, plain.joint_range)
    assert noted(robot, "Joints locked, whose limits are equal: lock.")
    data = robot.at_home.data
    place = data.body("hand").xpos - data.body("arm").xpos
    turned = np.radians(30.0)
    np.testing.assert_allclose(place, [0.3 * np.cos(turned), 0.3 * np.sin(turned), 0.0], atol=1e-9)


def test_limits_that_are_not_given_lock_nothing() -> None:
    joint = hinge("arm", "trunk", "arm", '<limit effort="1" velocity="1"/>')
    assert Robot.from_mjcf(dog(link("arm") + joint)).num_joints == 9


def test_fingers_that_follow_are_locked_and_legs_that_do_are_refused() -> None:
    fingers = link("thumb") + link("finger") + hinge("thumb", "trunk", "thumb")
    follows = hinge("finger", "trunk", "finger", LIMIT + '<mimic joint="thumb" multiplier="2"/>')
    robot = Robot.from_mjcf(dog(fingers + follows))
    assert robot.num_joints == 8
    assert noted(robot, "which an <equality> or <mimic> ties: thumb, finger.")
    knee = '<joint name="front_left_knee" type="revolute">'
    tied = urdf().replace(knee, knee + '<mimic joint="front_left_hip"/>')
    with pytest.raises(RobotError, match="joint of front_left_knee, front_left_hip"):
        Robot.from_mjcf(tied)


@pytest.mark.parametrize("kind", ["floating", "planar", "prismatic"])
def test_massless_links_that_move_a_base_about_are_left_out(kind: str) -> None:
    root = '<link name="map"/><link name="odom"/><link name="base"/>'
    chain = '<joint name="to_odom" type="fixed"><parent link="map"/><child link="odom"/></joint>'
    limit = '<limit effort="1" velocity="1" lower="-9" upper="9"/>' if kind != "floating" else ""
    chain += hinge("to_base", "odom", "base", limit, kind)
    robot = Robot.from_mjcf(dog(base=root + chain))
    assert robot.num_joints == 8 and robot.mass == pytest.approx(Robot.from_mjcf(urdf()).mass)


def test_meshes_are_converted_or_done_without_where_no_foot_needs_them(tmp_path: Path) -> None:
    """A box as ASCII STL, which MuJoCo does not read, comes out as the box."""
    trimesh = pytest.importorskip("trimesh")
    folder = tmp_path / "dog" / "meshes"
    folder.mkdir(parents=True)
    path = tmp_path / "dog" / "dog.urdf"
    path.write_text(urdf(trunk=MESH))
    bare = Robot.from_mjcf(path)
    assert noted(bare, "Meshes that the bodies trunk collide with left out")
    box = trimesh.creation.box([0.5, 0.14, 0.1])
    (folder / "trunk.stl").write_text(trimesh.exchange.stl.export_stl_ascii(box))
    robot = Robot.from_mjcf(path)
    assert noted(robot, "1 meshes converted")
    mesh = robot.model.mesh("trunk")
    found = robot.model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
    np.testing.assert_allclose(np.sort(np.ptp(found, axis=0)), [0.1, 0.14, 0.5], atol=1e-6)
    robot.save(tmp_path / "dog.zip")
    assert Robot.load(tmp_path / "dog.zip").digest == robot.portable().digest


def test_a_foot_that_lost_its_mesh_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "dog.urdf"
    sphere, mesh = '<sphere radius="0.02"/>', '<mesh filename="foot.dae"/>'
    path.write_text(urdf().replace(sphere, mesh))
    with pytest.raises(RobotError, match=r"Meshes of the bodies .*front_left_foot.* stand on|feet"):
        Robot.from_mjcf(path)


GO1 = (Path(__file__).parents[2] / "assets" / "go1.xml").read_text()


def changed(old: str, new: str) -> Robot:
    assert old in GO1
    return Robot.from_mjcf(GO1.replace(old, new, 1))


def with_knee(attribute: str, text: str = GO1) -> str:
    """A file whose front left knee has an attribute, in place of the one that it had."""
    knee, name = '<joint name="front_left_knee"', attribute.partition("=")[0]
    text = text.replace(knee, knee.replace(" ", f" {attribute} ", 1))
    return re.sub(rf'(<joint {re.escape(attribute)} [^>]*?) {name}="[^"]*"', r"\1", text)


def test_idle_joints_beside_the_robot_are_left_out() -> None:
    door = '<body name="door" pos="3 0 1"><joint name="door"/><geom size="0.1"/></body>'
    robot = changed("</worldbody>", door + "</worldbody>")
    assert robot.num_joints == 12 and noted(robot, "Idle joints beside the robot left out: door.")


def test_joints_tied_to_a_constant_are_locked() -> None:
    tie = '<equality><joint joint1="front_left_hip_roll" polycoef="0.2 0 0 0 0"/></equality>'
    robot = changed("</worldbody>", "</worldbody>" + tie)
    assert robot.num_joints == 11 and "front_left_hip_roll" not in robot.joint_names
    free = load("go1")
    pose = free.home_qpos.copy()
    pose[7:] = free.model.qpos0[7:]
    pose[7 + free.joint_names.index("front_left_hip_roll")] = 0.2
    data = posed(free, pose)
    own = posed(robot, np.append(pose[:7], robot.model.qpos0[7:]))
    for foot in free.feet:
        name = free.model.body(foot.body).name
        np.testing.assert_allclose(own.body(name).xpos, data.body(name).xpos, atol=1e-9)


@pytest.mark.parametrize("off, fine", [(0.02, True), (1.0, False)])
def test_keyframes_a_little_out_of_range_are_clipped(off: float, fine: bool) -> None:
    go1 = load("go1")
    pose = go1.home_qpos.copy()
    pose[8] = go1.joint_range[1, 1] + off
    key = f'<keyframe><key name="home" qpos="{" ".join(map(str, pose))}"/></keyframe></mujoco>'
    text = GO1.replace("</mujoco>", key)
    if fine:
        robot = Robot.from_mjcf(text)
        assert noted(robot, "Keyframes clipped to the joints' ranges: home.")
        assert robot.home_qpos[8] == pytest.approx(go1.joint_range[1, 1])
    else:
        with pytest.raises(RobotError, match="outside their range"):
            Robot.from_mjcf(text)


def ball(radius: float, faces: int) -> str:
    """Vertices of a ball, or of a cylinder that lies across."""
    turn = 2.0 * np.pi * np.arange(faces)[:, None] / faces
    tilt = np.pi * (np.arange(faces) + 0.5) / faces + 0.0 * turn
    points = np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)
    return " ".join(f"{radius * x:.7f}" for x in np.stack(points, axis=-1).ravel())


MESH_FOOT = '<geom type="mesh" mesh="sole" mass="1"/>'


@pytest.mark.parametrize(
    ("shape", "faces"),
    [
        (MESH_FOOT, 16),
        (MESH_FOOT, 32),
        ('<geom type="capsule" size="0.02 0.01" euler="90 0 0" mass="1"/>', 16),
        ('<geom type="cylinder" size="0.02 0.01" euler="90 0 0" mass="1"/>', 16),
    ],
)
def test_a_small_round_foot_is_one_sphere(shape: str, faces: int) -> None:
    """However many vertices it has: its point stays where it touches when the robot leans."""
    text = FOOT.format(vertices=ball(0.02, faces), shape=shape)
    robot = Robot.from_mjcf(text, ["foot"])
    foot = robot.feet[0]
    assert foot.num_points == 1 and foot.radius == pytest.approx(0.02, rel=0.35)
    leaning = np.array([np.cos(0.1), 0.0, np.sin(0.1), 0.0])
    data = posed(robot, np.concatenate([robot.home_qpos[:3], leaning, robot.home_qpos[7:]]))
    data.qpos[2] -= foot.touching(data)[0, 2] + 1e-3
    mujoco.mj_forward(robot.model, data)
    assert data.ncon and data.contact.dist.min() == pytest.approx(-1e-3, abs=1e-3)
    place = data.contact.pos[:, :2].mean(axis=0)
    np.testing.assert_allclose(place, foot.touching(data)[0, :2], atol=4e-3)


def test_wheels_are_refused() -> None:
    wheel = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
    text = urdf()
    for leg in LEGS:
        fixed = f'<joint name="{leg}_ankle" type="fixed"><origin xyz="0 0 -0.2"/>'
        spins = f'<joint name="{leg}_ankle" type="continuous"><origin xyz="0 0 -0.2"/>'
        spins += '<axis xyz="0 1 0"/><limit effort="5" velocity="9"/>'
        assert fixed in text and wheel in text
        text = text.replace(fixed, spins)
    with pytest.raises(RobotError, match="Feet front_left_foot, .* turn about themselves"):
        Robot.from_mjcf(text)


def test_bodies_that_lie_in_one_another_at_home_touch_no_more() -> None:
    trunk = '<box size="0.5 0.15 0.1"/>'
    thigh = '<collision><geometry><sphere radius="0.04"/></geometry></collision></link>'
    name = 'name="front_left_upper">'
    text = urdf(trunk).replace(name, name + thigh.replace("</link>", ""))
    # A parent is no pair of its own: the knee's link reaches into the trunk.
    name = 'name="front_left_lower">'
    reach = '<collision><origin xyz="0 0 0.2"/><geometry><sphere radius="0.04"/></geometry>'
    robot = Robot.from_mjcf(text.replace(name, name + reach + "</collision>"), home={})
    assert noted(robot, "Lie in one another at home, and touch no more: trunk and front_left_lower")
    data = posed(robot)
    assert not np.any(robot.model.body_weldid[robot.model.geom_bodyid[data.contact.geom]].all(1))


@pytest.mark.parametrize(
    "flag, attribute, field",
    [
        ("spring", "stiffness", "jnt_stiffness"),
        ("damper", "damping", "dof_damping"),
        ("frictionloss", "frictionloss", "dof_frictionloss"),
    ],
)
def test_what_a_flag_switches_off_is_gone(flag: str, attribute: str, field: str) -> None:
    text = GO1.replace("<option ", f'<option><flag {flag}="disable"/></option><option ', 1)
    robot = Robot.from_mjcf(with_knee(f'{attribute}="2"', text))
    assert not np.any(getattr(robot.model, field)) and noted(robot, "switches them off")


def test_a_friction_that_overrides_is_that_of_the_geoms() -> None:
    option = '<option o_friction="0.3 0.3 0.01 0.001 0.001"><flag override="enable"/></option>'
    robot = Robot.from_mjcf(GO1.replace("<option ", option + "<option ", 1))
    own = robot.at_home.touching & ~robot.at_home.ground
    assert set(robot.model.geom_friction[own, 0]) == {0.3}
    assert any("friction is 0.3" in sentence for sentence in robot.check())


@pytest.mark.parametrize("name", ["dog.XML", "dog.xml"])
def test_a_byte_order_mark_and_a_suffix_in_capitals(name: str, tmp_path: Path) -> None:
    path = tmp_path / name
    path.write_bytes(b"\xef\xbb\xbf" + GO1.encode())
    assert Robot.from_mjcf(path).mass == load("go1").mass
    assert Robot.from_mjcf("\ufeff" + GO1).mass == load("go1").mass


def test_a_path_of_thousands_of_letters_is_one_short_error() -> None:
    with pytest.raises(RobotError, match="does not exist. Expected the path of an MJCF or URDF"):
        Robot.from_mjcf("a" * 5000)
    with pytest.raises(RobotError) as error:
        Robot.from_mjcf("a" * 5000)
    assert len(str(error.value)) < 500


def test_a_small_framebuffer_and_names_in_brackets() -> None:
    """Brackets of a name are no pattern."""
    small = '<visual><global offwidth="64" offheight="48"/></visual><worldbody>'
    text = GO1.replace("<worldbody>", small, 1).replace("front_left_knee", "knee[fl]")
    robot = Robot.from_mjcf(text, armature={"*": 0.01, "knee[fl]": 0.02})
    own = dict(zip(robot.joint_names, robot.model.dof_armature[6:], strict=True))
    assert own.pop("knee[fl]") == 0.02 and set(own.values()) == {0.01}
    assert portrait(robot).shape[2] == 3


def test_a_word_in_a_comment_makes_no_urdf() -> None:
    text = GO1.replace("<mujoco", "<!-- from a <robot> -->\n<mujoco", 1)
    assert Robot.from_mjcf(text).mass == load("go1").mass


def test_a_foot_that_a_file_fuses_with_its_leg_keeps_its_name() -> None:
    foot = '<geom name="front_left_foot" class="foot" pos="0 0 -0.213"/>'
    text = GO1.replace(foot, f'<body name="paw">{foot}</body>', 1)
    text = text.replace("<compiler ", '<compiler fusestatic="true" ', 1)
    assert "paw" in Robot.from_mjcf(text).foot_names


@pytest.mark.parametrize("kind", ["connect", "weld"])
def test_loops_are_refused_by_the_names_of_their_bodies(kind: str) -> None:
    legs = "front_left_lower_leg", "front_right_lower_leg"
    place = ' anchor="0 0 0"' if kind == "connect" else ""
    tie = f'<equality><{kind} body1="{legs[0]}" body2="{legs[1]}"{place}/></equality></mujoco>'
    with pytest.raises(RobotError, match=".*".join(legs)):
        changed("</mujoco>", tie)


def test_names_of_ours_may_be_in_a_file() -> None:
    own = '<asset><texture name="fbid_sky" type="skybox" builtin="flat" width="8" height="8"/>'
    own += '<material name="fbid_ground"/></asset><worldbody>'
    robot = changed("<worldbody>", own)
    assert robot.model.nmat == load("go1").model.nmat + 1
    for terrain in (random_obstacles, random_rocks):
        spec = robot.spec.copy()
        for name in ("fbid_plank", "fbid_field"):
            spec.add_material(name=name)
        terrain(0.5, 0.05, np.zeros((1, 2)), np.random.default_rng(0)).add_to(spec)
        spec.compile()


@pytest.mark.parametrize(
    "attribute",
    [
        *('armature="-1"', 'damping="1e30"', 'stiffness="1e30"', 'pos="0 0 1e30"'),
        *('frictionloss="-1"', 'frictionloss="1e30"'),
    ],
)
def test_numbers_that_no_simulation_carries_are_refused(attribute, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotError):
        Robot.from_mjcf(with_knee(attribute))
    with pytest.raises(RobotError, match=r"armature 1e\+30, which no simulation can carry"):
        Robot.from_mjcf(GO1, armature=1e30)
    assert not list(tmp_path.iterdir())  # no MUJOCO_LOG.TXT
