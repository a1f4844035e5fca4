"""Pictures and videos, and a clear word where there is no display."""

import itertools

import gymnasium as gym
import imageio_ffmpeg
import mujoco
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo

import fbid_gym
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.insight import insight
from fbid_gym.envs.overlays import LABELS, RenderOptions, marks, size_of
from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot
from fbid_gym.robots.geoms import add_arrow, add_thread
from tests.batches import assert_same, begun
from tests.dynamics.models import ASSETS
from tests.pairs import pairs

BIPED = "fbid_gym/BipedBalance-v0"
SHAPE = (240, 320, 3)  # a picture of the usual size takes four times as long
ARGUMENTS = {
    "action_layer": "joint_position", "render_mode": "rgb_array", "width": 320, "height": 240,
}  # fmt: skip
EVERYTHING = dict.fromkeys(LABELS, True)
DRAWN = ARGUMENTS | {"render_options": EVERYTHING}


def assert_same_picture(one, other):
    """Software renderers round a texture's far end differently from time to time."""
    assert np.abs(one.astype(int) - other.astype(int)).mean() < 1.0


def assert_picture(frame):
    assert frame.shape == SHAPE and frame.dtype == np.uint8
    assert frame.std() > 20.0  # sky, ground and a robot, not one colour


# Of a curriculum's ground, 200 m long, the first picture differs here: not understood.
SHOWN = [name for name in list(ENVIRONMENTS)[::3] if not ENVIRONMENTS[name].get("curriculum")]


@pytest.mark.parametrize("name", SHOWN)
def test_pictures_show_what_happens(name):
    env = begun(name, **ARGUMENTS)
    first = env.render()
    assert_picture(first)
    assert_same_picture(env.render(), first)  # looking changes nothing
    for _ in range(5):
        env.step(np.full(env.action_space.shape, 0.5, np.float32))
    later = env.render()
    assert_picture(later)
    assert (np.abs(first.astype(int) - later.astype(int)).max(axis=2) > 50).mean() > 0.005
    env.close()
    env.close()  # twice is no error


def test_a_push_is_an_arrow():
    env = begun("fbid_gym/BipedBalance-v0", **ARGUMENTS)
    plain = env.render().astype(int)
    batch = env.unwrapped.batch
    force = np.array([[100.0, 100.0, 0.0]])
    batch.simulation.push(force)
    pushed = env.render().astype(int)
    red = (pushed[..., 0] > 150) & (pushed[..., 1:].max(axis=2) < 100)
    changed = (pushed != plain).any(axis=2)
    assert 25 < (red & changed).sum() < 5000
    assert not ((plain[..., 0] > 150) & (plain[..., 1:].max(axis=2) < 100)).any()
    env.close()


def test_vector_environments_show_everyone():
    envs = begun("fbid_gym/QuadrupedBalance-v0", 2, num_threads=2, **ARGUMENTS)
    frames = envs.render()
    assert isinstance(frames, tuple) and len(frames) == 2
    for index, frame in enumerate(frames):
        assert_picture(frame)
        alone = begun("fbid_gym/QuadrupedBalance-v0", seed=index, **ARGUMENTS)
        assert_same_picture(alone.render(), frame)
        alone.close()
    envs.close()
    sb3 = fbid_gym.make_sb3("fbid_gym/QuadrupedBalance-v0", 2, seed=0, **ARGUMENTS)
    sb3.reset()
    for ours, theirs in zip(sb3.get_images(), frames, strict=True):
        assert_same_picture(ours, theirs)
    assert sb3.render().shape == (2 * SHAPE[0], SHAPE[1], 3)  # all in one picture
    sb3.close()


def test_record_video_of_one(tmp_path):
    env = gym.make("fbid_gym/BipedBalance-v0", **DRAWN, episode_seconds=0.2)
    env = RecordVideo(env, str(tmp_path / "videos"), disable_logger=True)
    env.reset(seed=0)
    truncated = False
    while not truncated:
        *_, truncated, _ = env.step(np.zeros(16, np.float32))
    env.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert 10 <= imageio_ffmpeg.count_frames_and_secs(str(video))[0] <= 11


def standing(layer="base_acceleration", **arguments):
    env = begun("fbid_gym/BipedBalance-v0", **ARGUMENTS | {"action_layer": layer}, **arguments)
    return env, env.unwrapped.batch


def marks_of(batch, **shown):
    size = size_of(batch.task.body.stance)
    found = marks(RenderOptions(**shown), insight(batch), size, batch.robot.weight)
    return {mark.name: mark for mark in found}


def test_forces_of_a_robot_that_stands_point_into_the_rims_of_their_cones():
    env, batch = standing(push_force=(0.0, 0.0))
    for _ in range(60):
        env.step(np.zeros(6, np.float32))
    found = marks_of(batch, forces=True, cones=True, support=True, com=True)
    for name in ("measured", "commanded"):
        arrows = found[name].ends[:, 1] - found[name].ends[:, 0]
        share = arrows[:, 2].sum() / (0.25 * size_of(batch.task.body.stance) * len(arrows))
        assert share == pytest.approx(1.0, abs=0.05)  # an even share: a quarter of the size
    cones = [mark for name, mark in found.items() if name.startswith("cone")]
    arrows = found["measured"].place + found["measured"].ends
    assert len(cones) == len(arrows) == batch.robot.num_points
    for cone, (start, end) in zip(cones, arrows, strict=True):
        rim = cone.ends[-1, 0]  # the last lines are the rim
        assert cone.place == pytest.approx(start) and end[2] - start[2] == pytest.approx(rim[2])
        assert np.hypot(*(end - start)[:2]) < np.hypot(*rim[:2])
        assert np.hypot(*rim[:2]) == pytest.approx(0.6 * rim[2])  # the friction that is assumed
    corners = found["support"].place + found["support"].ends[:, 0]
    assert corners[:, :2].min(axis=0) == pytest.approx(arrows[:, 0, :2].min(axis=0))
    centre = found["pressure"].place
    assert (corners.min(axis=0)[:2] < centre[:2]).all() and (centre < corners.max(axis=0))[:2].all()
    assert found["pressure"].place[:2] == pytest.approx(found["com"].place[:2], abs=0.02)
    env.close()


def test_what_is_achieved_is_what_the_velocity_gained():
    env, batch = standing(push_force=(0.0, 0.0))
    assert not len(marks_of(batch, acceleration=True)["achieved"].ends)  # nothing has happened yet
    for _ in range(60):
        env.step(np.zeros(6, np.float32))
    before = batch.simulation.terms().com_velocity[0].copy()
    env.step(np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0], np.float32))
    gained = (batch.simulation.terms().com_velocity[0] - before) * batch.rates.policy
    seen = insight(batch)
    assert seen.achieved == pytest.approx(gained)
    # The body goes on as it is asked, all but for what the step changed of that.
    assert np.linalg.norm(seen.desired - seen.achieved) < 0.5 * np.linalg.norm(gained)
    assert np.linalg.norm(gained) > 0.2
    env.close()


def test_footholds_lie_where_feet_land():
    arguments = ARGUMENTS | {"action_layer": "base_acceleration", "forward_range": (0.4, 0.5)}
    env = begun("fbid_gym/QuadrupedWalk-v0", seed=1, **arguments)
    batch, spots, landed = env.unwrapped.batch, np.zeros((0, 3)), 0
    for _ in range(45):
        env.step(np.zeros(env.action_space.shape, np.float32))
        seen = insight(batch)
        if len(spots) and not len(seen.footholds):  # all feet have come down
            away = np.linalg.norm(seen.points[:, None] - spots, axis=2).min(axis=0)
            assert (away < 0.03).all()
            landed += len(spots)
        spots = seen.footholds
    assert landed >= 4
    env.close()


LAYERS_SEEN = ("base_acceleration", "com_wrench", "joint_position", "joint_acceleration")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "layer"), pairs([BIPED, "fbid_gym/QuadrupedTerrain-v0"], LAYERS_SEEN)
)
def test_drawing_changes_nothing(name, layer):
    chance = {"mass": 0.1, "model_mass": 0.1, "action_delay": (0.0, 0.03)}
    arguments = ARGUMENTS | {"action_layer": layer, "randomisation": chance, "num_threads": 2}
    plain, drawn = (
        begun(name, 3, 4, render_options=shown, **arguments) for shown in (None, EVERYTHING)
    )
    rng = np.random.default_rng(0)
    for step in range(6):
        for batch in drawn.chunks.batches:
            insight(batch, batch.num_envs - 1)  # all that drawing asks
        if step == 2:
            drawn.render()
        action = rng.uniform(-0.5, 0.5, plain.action_space.shape).astype(np.float32)
        one, other = plain.step(action), drawn.step(action)
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
    assert_same(plain.chunks.state_dict(), drawn.chunks.state_dict())
    for envs in (plain, drawn):
        envs.close()


def test_overlays_are_seen_and_are_off_by_default():
    env, _ = standing()
    plain = env.render()
    env.close()
    env, _ = standing(render_options={})
    assert_same_picture(env.render(), plain)
    env.close()
    for kind in ("forces", "cones", "com", "support"):
        env, _ = standing(render_options={kind: True})
        for _ in range(3):
            env.step(np.zeros(6, np.float32))
        changed = np.abs(env.render().astype(int) - plain.astype(int)).max(axis=2) > 40
        assert changed.mean() > 0.001, kind
        env.close()


@pytest.mark.parametrize("kind", [mujoco.mjtGeom.mjGEOM_LINE, mujoco.mjtGeom.mjGEOM_ARROW])
def test_arrows_and_lines_end_where_they_are_to_end(kind):
    """MuJoCo draws half of an arrow."""
    add = add_arrow if kind == mujoco.mjtGeom.mjGEOM_ARROW else add_thread
    model = mujoco.MjModel.from_xml_string("<mujoco/>")
    data, camera = mujoco.MjData(model), mujoco.MjvCamera()
    mujoco.mj_forward(model, data)
    camera.distance, camera.azimuth, camera.elevation = 10.0, 90.0, 0.0
    heights = []
    with mujoco.Renderer(model, 240, 240) as renderer:
        for end in (1.0, 2.0):
            renderer.update_scene(data, camera)
            add(renderer.scene, np.zeros(3), np.array([0.0, 0.0, end]), 0.1, (1.0, 1.0, 1.0, 1.0))
            rows = np.flatnonzero(renderer.render().any(axis=(1, 2)))
            heights.append(120 - rows.min())
    pixels = 120 / (10.0 * np.tan(np.radians(22.5)))  # in a metre, 10 m away
    assert heights == pytest.approx([pixels, 2 * pixels], abs=2.5)


def test_human_mode_needs_a_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    message = "'human' needs a display. Use 'rgb_array' instead"
    for make in (gym.make, gym.make_vec):  # some make one that they never draw
        env = make(BIPED, render_mode="human")
        with pytest.raises(FbidError, match=message):
            env.reset(seed=0)
    with pytest.raises(FbidError, match=message):
        fbid_gym.make_sb3(BIPED, render_mode="human")


def picture(**arguments):
    """The first picture of an episode."""
    env = begun(BIPED, **ARGUMENTS | arguments)
    frame = env.render()
    env.close()
    return frame


@pytest.mark.slow
def test_size_and_camera_of_a_picture():
    assert picture(width=96, height=1200).shape == (1200, 96, 3)
    aims = ({}, {"azimuth": 0.0}, {"distance": 9.0, "elevation": -60.0})
    frames = [picture(default_camera_config=aim).astype(int) for aim in aims]
    for one, other in itertools.pairwise(frames):
        assert np.abs(one - other).mean() > 3.0
    robot = Robot.from_mjcf(ASSETS / "humanoid.xml", ["left_foot", "right_foot"])
    cameras = ({}, {"camera_name": "track"}, {"camera_id": 0})
    plain, named, numbered = (picture(robot=robot, **camera) for camera in cameras)
    assert_same_picture(named, numbered)
    assert np.abs(plain.astype(int) - named).mean() > 3.0
    for bad, message in (
        ({"camera_name": "left"}, "Unknown camera_name 'left'. Valid choices: "),
        ({"camera_id": 7}, "Invalid camera_id: 7. Expected one of the robot's cameras, of which"),
        ({"default_camera_config": {"zoom": 1.0}}, "Unknown default_camera_config 'zoom'. Valid"),
    ):
        with pytest.raises(FbidError, match=message):
            gym.make(BIPED, **ARGUMENTS, **bad)


def test_without_a_render_mode_nothing_is_drawn():
    for env in (gym.make(BIPED).unwrapped, gym.make_vec(BIPED, num_envs=2)):
        env.reset(seed=0)
        with pytest.warns(UserWarning, match="without a render_mode draws nothing"):
            assert env.render() is None
