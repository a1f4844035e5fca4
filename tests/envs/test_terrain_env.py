"""Environments on ground that is not level: where episodes start, and what the feet meet."""

import numpy as np
import pytest

from fbid_gym.dynamics.contacts import contact_geometry, point_positions
from tests.batches import begun

ROUGH = "fbid_gym/QuadrupedRough-v0"


@pytest.mark.parametrize("terrain", ["obstacles", "rocks"])
def test_episodes_start_on_level_places_all_over_the_ground(terrain):
    env = begun(ROUGH, 64, terrain=terrain)
    batch = env.chunks.batches[0]
    simulation, starts = batch.simulation, batch.terrain.starts
    apart = np.linalg.norm(simulation.qpos[:, None, :2] - starts, axis=2)
    nearest = apart.argmin(axis=1)
    assert (apart.min(axis=1) < batch.terrain.clearing).all()
    assert set(nearest) == set(range(len(starts)))
    points = point_positions(contact_geometry(batch.robot), simulation.terms())
    np.testing.assert_allclose(points[:, :, 2].min(axis=1), 0.0, atol=1e-9)
    np.testing.assert_array_equal(batch.terrain.height(points[..., 0], points[..., 1]), 0.0)


@pytest.mark.parametrize("terrain", ["obstacles", "rocks"])
def test_feet_stand_on_the_terrain_not_in_it(terrain):
    """Put down anywhere, the feet come to rest on its surface."""
    given = {"action_layer": "joint_position", "autoreset_mode": "DISABLED"}
    env = begun(ROUGH, 32, terrain=terrain, **given)
    batch = env.chunks.batches[0]
    simulation, rng = batch.simulation, np.random.default_rng(0)
    simulation.qpos[:, :2] = rng.uniform(-2.5, 2.5, (32, 2))
    simulation.qpos[:, 2] += 0.05
    simulation.qvel[:] = 0.0
    simulation.batch.forward()
    for _ in range(25):
        step = batch.step(np.zeros((32, 12)))
    points = point_positions(contact_geometry(batch.robot), simulation.terms())
    ground = batch.terrain.height(points[..., 0], points[..., 1])
    # A sphere that leans on an edge touches beside its lowest point.
    assert (points[..., 2] > ground - 0.012)[step.info["termination"] == 0].all()
    assert ground.max() > 0.5 * batch.config.resolved()["terrain_height"]
    loaded = step.info["contact_force"][..., 2].sum(axis=1)
    np.testing.assert_allclose(np.median(loaded), batch.robot.weight, rtol=0.3)


def test_no_height_is_flat():
    flat = begun(ROUGH, seed=3, terrain_height=0.0, action_layer="base_acceleration")
    level = begun("fbid_gym/QuadrupedCrawl-v0", seed=3, action_layer="base_acceleration")
    action = np.zeros(6, np.float32)
    for _ in range(20):
        np.testing.assert_array_equal(flat.step(action)[0], level.step(action)[0])
