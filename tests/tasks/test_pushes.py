"""Pushes: drawn as promised, applied for as long as promised."""

import numpy as np
import pytest

from fbid_gym.errors import InvalidValueError
from fbid_gym.tasks import Pushes

SECONDS, HZ = 10.0, 500


@pytest.fixture
def pushes():
    return Pushes(force=(20.0, 100.0), duration=0.15, interval=(1.5, 3.0))


def drawn(pushes, count, seed=0):
    rng = np.random.default_rng(seed)
    start, force = zip(*(pushes.draw(rng, SECONDS, HZ) for _ in range(count)), strict=True)
    return np.array(start), np.array(force)


def test_pushes_begin_within_the_episode_and_keep_their_distance(pushes):
    start, _ = drawn(pushes, 500)
    used = start < SECONDS * HZ
    assert (used.sum(axis=1) >= SECONDS // 3.0).all()
    assert (start[~used] > 1e6 * SECONDS * HZ).all()
    # The first interval counts from the start of the episode. Ticks are rounded.
    gaps = np.diff(np.concatenate([np.zeros((500, 1), int), start], axis=1), axis=1)[used]
    assert gaps.min() >= 1.5 * HZ - 1
    assert gaps.max() <= 3.0 * HZ + 1
    assert np.abs(np.mean(gaps) / HZ - 2.25) < 0.1


def test_pushes_are_horizontal_isotropic_and_of_the_given_size(pushes):
    _, force = drawn(pushes, 1000)
    force = force.reshape(-1, 3)
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


def test_the_same_generator_draws_the_same_pushes(pushes):
    for first, second in zip(drawn(pushes, 3, seed=5), drawn(pushes, 3, seed=5), strict=True):
        np.testing.assert_array_equal(first, second)
    assert (drawn(pushes, 3, seed=5)[1] != drawn(pushes, 3, seed=6)[1]).any()


def test_a_push_lasts_its_duration(pushes):
    start, force = drawn(pushes, 4)
    ticks = np.arange(int(SECONDS * HZ))
    applied = pushes.at(start, force, ticks[:, None].repeat(4, axis=1), HZ)
    expected = np.zeros((len(ticks), 4, 3))
    for env in range(4):
        for first, push in zip(start[env], force[env], strict=True):
            expected[first : first + 75, env] = push
    np.testing.assert_array_equal(applied, expected)
    # One row of ticks is one instant of each robot.
    np.testing.assert_array_equal(pushes.at(start, force, np.full(4, 900), HZ), expected[900])


def test_no_pushes_at_all():
    start, force = Pushes((0.0, 0.0), 0.15, (1.5, 3.0)).draw(np.random.default_rng(0), 10.0, HZ)
    assert (force == 0.0).all() and len(start) == len(force)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"force": (50.0, 20.0)},
            r"Invalid push_force: \(50.0, 20.0\). Expected a pair 0 <= least",
        ),
        ({"force": (-1.0, 20.0)}, "Invalid push_force"),
        ({"force": (0.0, np.inf)}, "Invalid push_force"),
        ({"interval": (3.0, 1.0)}, "Invalid push_interval"),
        ({"interval": (0.1, 1.0)}, r"push_interval: \(0.1, 1.0\). Expected at least push_duration"),
        ({"duration": 0.0}, "Invalid push_duration: 0.0. Expected a positive time"),
        ({"duration": np.nan}, "Invalid push_duration: nan"),
    ],
)
def test_bad_ranges_are_errors(arguments, message):
    good = {"force": (20.0, 100.0), "duration": 0.15, "interval": (1.5, 3.0)}
    with pytest.raises(InvalidValueError, match=message):
        Pushes(**(good | arguments))
