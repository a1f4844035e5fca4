"""Pushes: drawn as promised, applied for as long as promised."""

from dataclasses import replace

import numpy as np
import pytest

from fbid_gym.tasks import Pushes

SECONDS, HZ = 10.0, 500


@pytest.fixture
def pushes():
    return Pushes(force=(20.0, 100.0), duration=0.15, interval=(1.5, 3.0))


def drawn(pushes, count, seed=0):
    rng = np.random.default_rng(seed)
    plans = [pushes.draw(rng, SECONDS, HZ) for _ in range(count)]
    return {name: np.array([plan[name] for plan in plans]) for name in plans[0]}


def test_pushes_begin_within_the_episode_and_keep_their_distance(pushes):
    start = drawn(pushes, 500)["push_start"]
    used = start < SECONDS * HZ
    assert (used.sum(axis=1) >= SECONDS // 3.0).all()
    assert (start[~used] > 1e6 * SECONDS * HZ).all()
    # The first interval counts from the start of the episode. Ticks are rounded.
    gaps = np.diff(np.concatenate([np.zeros((500, 1), int), start], axis=1), axis=1)[used]
    assert gaps.min() >= 1.5 * HZ - 1
    assert gaps.max() <= 3.0 * HZ + 1
    assert np.abs(np.mean(gaps) / HZ - 2.25) < 0.1


def test_pushes_are_horizontal_isotropic_and_of_the_given_size(pushes):
    force = drawn(pushes, 1000)["push_force"].reshape(-1, 3)
    assert (force[:, 2] == 0.0).all()
    size = np.linalg.norm(force, axis=1)
    assert size.min() >= 20.0 and size.max() <= 100.0
    # The first moments of a uniform distribution, of size and direction, within five deviations.
    count = len(force)
    assert np.abs(size.mean() - 60.0) < 5.0 * 80.0 / np.sqrt(12.0 * count)
    direction = (force[:, 0] + 1j * force[:, 1]) / size
    for harmonic in (1, 2, 3, 4):
        assert np.abs((direction**harmonic).mean()) < 5.0 / np.sqrt(count)
    assert np.abs((direction * size).mean()) < 5.0 * 100.0 / np.sqrt(count)


def test_a_push_lasts_its_duration(pushes):
    plan = drawn(pushes, 4)
    ticks = np.arange(int(SECONDS * HZ))
    applied = pushes.during(plan, np.zeros(4, int), len(ticks), HZ)
    expected = np.zeros((len(ticks), 4, 3))
    for env in range(4):
        for first, push in zip(plan["push_start"][env], plan["push_force"][env], strict=True):
            expected[first : first + 75, env] = push
    np.testing.assert_array_equal(applied.force, expected)
    assert not applied.jump.any() and not applied.jumping.any()
    # Each robot has a first tick of its own.
    later = pushes.during(plan, 900 + 50 * np.arange(4), 7, HZ).force
    for env in range(4):
        np.testing.assert_array_equal(later[:, env], expected[900 + 50 * env :][:7, env])


def test_a_jump_of_velocity_is_at_one_instant_and_as_strong_as_the_force(pushes):
    plan = drawn(replace(pushes, velocity=(0.1, 0.5)), 4)
    ticks = np.arange(int(SECONDS * HZ))
    jumped = pushes.during(plan, np.zeros(4, int), len(ticks), HZ)
    expected = np.zeros((len(ticks), 4, 3))
    for env in range(4):
        used = plan["push_start"][env] < len(ticks)
        expected[plan["push_start"][env][used], env] = plan["push_velocity"][env][used]
    np.testing.assert_array_equal(jumped.jump, expected)
    np.testing.assert_array_equal(jumped.jumping, expected.any(axis=(1, 2)))
    force, jump = (plan[name].reshape(-1, 3) for name in ("push_force", "push_velocity"))
    newtons, speed = np.linalg.norm(force, axis=1), np.linalg.norm(jump, axis=1)
    np.testing.assert_allclose((speed - 0.1) / 0.4, (newtons - 20.0) / 80.0)
    np.testing.assert_allclose(jump / speed[:, None], force / newtons[:, None])
