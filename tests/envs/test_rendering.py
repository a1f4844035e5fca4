"""Pictures and videos, and a clear word where there is no display."""

import gymnasium as gym
import imageio_ffmpeg
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo
from gymnasium.wrappers.vector import RecordVideo as VectorRecordVideo

import fbid_gym
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import FbidError

SHAPE = (480, 640, 3)
ARGUMENTS = {"action_layer": "joint_position", "render_mode": "rgb_array"}


def assert_same_picture(one, other):
    """Software renderers round a texture's far end differently from time to time."""
    assert np.abs(one.astype(int) - other.astype(int)).mean() < 1.0


def assert_picture(frame):
    assert frame.shape == SHAPE and frame.dtype == np.uint8
    assert frame.std() > 20.0  # sky, ground and a robot, not one colour


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_pictures_show_what_happens(name):
    env = gym.make(name, **ARGUMENTS)
    env.reset(seed=0)
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
    env = gym.make("fbid_gym/BipedBalance-v0", **ARGUMENTS)
    env.reset(seed=0)
    plain = env.render().astype(int)
    batch = env.unwrapped.batch
    force = np.array([[100.0, 100.0, 0.0]])
    batch.simulation.push(force)
    pushed = env.render().astype(int)
    red = (pushed[..., 0] > 150) & (pushed[..., 1:].max(axis=2) < 100)
    changed = (pushed != plain).any(axis=2)
    assert 100 < (red & changed).sum() < 20000
    assert not ((plain[..., 0] > 150) & (plain[..., 1:].max(axis=2) < 100)).any()
    env.close()


def test_vector_environments_show_everyone():
    envs = gym.make_vec("fbid_gym/QuadrupedBalance-v0", num_envs=2, num_threads=2, **ARGUMENTS)
    envs.reset(seed=0)
    frames = envs.render()
    assert isinstance(frames, tuple) and len(frames) == 2
    for index, frame in enumerate(frames):
        assert_picture(frame)
        alone = gym.make("fbid_gym/QuadrupedBalance-v0", **ARGUMENTS)
        alone.reset(seed=index)
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
    env = gym.make("fbid_gym/BipedBalance-v0", **ARGUMENTS, episode_seconds=0.2)
    env = RecordVideo(env, str(tmp_path / "videos"), disable_logger=True)
    env.reset(seed=0)
    truncated = False
    while not truncated:
        *_, truncated, _ = env.step(np.zeros(16, np.float32))
    env.close()
    (video,) = (tmp_path / "videos").glob("*.mp4")
    assert 10 <= imageio_ffmpeg.count_frames_and_secs(str(video))[0] <= 11


def test_record_video_of_many(tmp_path):
    envs = gym.make_vec("fbid_gym/QuadrupedBalance-v0", num_envs=2, **ARGUMENTS)
    envs = VectorRecordVideo(envs, str(tmp_path / "videos"), video_length=8, disable_logger=True)
    envs.reset(seed=0)
    for _ in range(10):
        envs.step(np.zeros(envs.action_space.shape, np.float32))
    envs.close()
    videos = list((tmp_path / "videos").glob("*.mp4"))
    assert videos and all(video.stat().st_size > 1000 for video in videos)
    assert imageio_ffmpeg.count_frames_and_secs(str(videos[0]))[0] >= 8


def test_human_mode_needs_a_display(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    env = gym.make("fbid_gym/BipedBalance-v0", render_mode="human")
    with pytest.raises(FbidError, match="'human' needs a display. Use 'rgb_array' instead"):
        env.reset(seed=0)
    envs = gym.make_vec("fbid_gym/BipedBalance-v0", num_envs=2, render_mode="human")
    envs.reset(seed=0)
    with pytest.raises(FbidError, match="'human' needs a display"):
        envs.render()


def test_without_a_render_mode_nothing_is_drawn():
    for env in (
        gym.make("fbid_gym/BipedBalance-v0").unwrapped,
        gym.make_vec("fbid_gym/BipedBalance-v0", num_envs=2),
    ):
        env.reset(seed=0)
        with pytest.warns(UserWarning, match="without a render_mode draws nothing"):
            assert env.render() is None
