"""Walking on terrains: starts, ends, falls, what is seen of the ground, and the curriculum."""

import numpy as np
import pytest

from fbid_gym.dynamics.contacts import contact_geometry, point_positions
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.curriculum import Climb
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.robots.terrain import LEVELLED, Tiles
from fbid_gym.runtime.config import EnvConfig
from fbid_gym.tasks.height_scan import SCAN
from tests.batches import begun, outcome_of, started
from tests.pairs import pairs

QUADRUPED, BIPED = "fbid_gym/QuadrupedTerrain-v0", "fbid_gym/BipedTerrain-v0"


def batch_of(env: str = QUADRUPED, count: int = 8, **arguments: object) -> EnvBatch:
    return started(ENVIRONMENTS[env] | {"action_layer": "torque"} | arguments, count)


def still(batch: EnvBatch) -> np.ndarray:
    return np.zeros((batch.num_envs, len(batch.action_names)))


@pytest.mark.parametrize(("terrain", "env"), pairs(LEVELLED, [QUADRUPED, BIPED], 1))
def test_robots_start_on_the_ground_not_in_it(env: str, terrain: str) -> None:
    batch = batch_of(env, terrain=terrain, difficulty=1.0)
    points = point_positions(contact_geometry(batch.robot), batch.simulation.terms())
    above = points[..., 2] - batch.terrain.height(points[..., 0], points[..., 1])
    np.testing.assert_allclose(above.min(axis=1), 0.0, atol=1e-6)
    for i in range(batch.num_envs):
        weight = batch.simulation.contact_force[i, :, 2].sum()
        assert weight < 3.0 * batch.robot.weight  # nothing pushes it out of the ground
    # On high ground as on low: nobody has fallen.
    assert not batch.step(still(batch)).terminated.any()


def test_a_fall_is_judged_from_the_ground_under_the_feet() -> None:
    """A robot on a hill of more than its own height stands; let down to its feet, it lies."""
    batch = batch_of(terrain="slopes", difficulty=1.0)
    simulation, body = batch.simulation, batch.task.body
    assert simulation.qpos[:, 2].min() > 2.0 * body.home_height
    assert not outcome_of(batch).posture.fallen.any()
    simulation.qpos[:, 9::3] = -2.6  # knees
    simulation.qpos[:, 8::3] = 1.3  # hips
    simulation.batch.forward()
    simulation.note_change()
    assert outcome_of(batch).posture.fallen.all()


def test_the_end_of_the_ground_truncates() -> None:
    batch = batch_of()
    batch.simulation.qpos[3, 0] = 0.5 * batch.terrain.tiles.edge + 0.01
    step = batch.step(still(batch))
    assert step.truncated.tolist() == [i == 3 for i in range(8)]
    assert not step.terminated[3] and step.info["termination"][3] == 0


def test_the_scan_sees_the_ground_from_where_the_robot_stands() -> None:
    """Level ground is zeros; otherwise heights at the places that the names tell, from the feet."""
    batch = batch_of(terrain="stairs", difficulty=0.0, height_scan=True)
    blind = batch_of(terrain="stairs", difficulty=0.0)
    size = batch.observation().shape[1] - blind.observation().shape[1]
    assert size == len(SCAN) == len(batch.observation_names[-len(SCAN) :])
    assert abs(batch.observation()[:, -size:]).max() < 0.02  # the feet lift a little at the start
    np.testing.assert_array_equal(batch.observation()[:, :-size], blind.observation())

    batch = batch_of(terrain="stairs", difficulty=1.0, height_scan=True)
    terms, memory = batch.simulation.terms(), batch.loop.planned
    heading = np.arctan2(terms.world_from_base[:, 1, 0], terms.world_from_base[:, 0, 0])
    ahead = np.stack([np.cos(heading), np.sin(heading)], axis=1)
    left = np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
    for k, (x, y) in enumerate(batch.task.scan):
        place = terms.base_position[:, :2] + x * ahead + y * left
        told = batch.terrain.height(place[:, 0], place[:, 1]) - memory["seen_ground"]
        np.testing.assert_allclose(batch.observation()[:, k - size], told, atol=1e-6)


def test_success_leads_to_harder_ground_and_a_fall_to_easier(rng: np.random.Generator) -> None:
    config = EnvConfig(task="walk", robot="go1", terrain="mixed", curriculum=True)
    progress = Climb(5, Tiles(3, 1.0), config)
    assert (progress.level == 1).all()
    well, badly = 0.1, 0.3
    error = np.array([well, badly, well, well, badly])
    none = np.zeros(5, bool)
    progress.set_out(np.arange(5))
    progress.advance(error, 0.2, none, none)
    fell, lasted = np.array([0, 0, 1, 0, 0], bool), np.array([1, 1, 0, 0, 0], bool)
    progress.advance(error, 0.2, fell, lasted)
    assert progress.level.tolist() == [2, 1, 0, 1, 1]
    progress.advance(error, 0.2, fell, lasted)  # stepped on before they are reset
    assert progress.level.tolist() == [2, 1, 0, 1, 1]
    progress.set_out(np.arange(5))
    progress.advance(error, 0.2, fell, lasted)
    assert progress.level.tolist() == [2, 1, 0, 1, 1]  # there is no level beyond
    places = np.arange(12.0).reshape(6, 2)
    drawn = {tuple(progress.place(places, 0, rng)) for _ in range(40)}
    assert drawn == {tuple(place) for place in places[4:]}
    progress.begin(0)
    assert progress.level[0] == 1


def test_robots_that_fall_start_on_the_tile_of_the_level_below() -> None:
    batch = batch_of(curriculum=True, difficulty=0.5, episode_seconds=4.0)
    assert (batch._progress.level == 5).all()
    ended, told = np.zeros(8, bool), []
    while not ended.all():
        step = batch.step(-np.ones((8, len(batch.action_names))))
        done = step.terminated | step.truncated
        told.append(step.info["terrain_level"][~ended])
        ended |= done
    assert (np.concatenate(told) == 5).all()  # until their next episode
    assert (batch._progress.level == 4).all()
    batch.reset(np.arange(8))
    centre = batch._progress.level * batch.terrain.tiles.edge
    assert (abs(batch.simulation.qpos[:, 0] - centre) < 0.5 * batch.terrain.tiles.edge).all()
    assert not batch.step(still(batch)).terminated.any()


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
