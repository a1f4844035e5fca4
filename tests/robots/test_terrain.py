"""Terrains: the height that is told is the height that is there, starts are level, bad input."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from fbid_gym.errors import FbidError
from fbid_gym.robots import Robot, load
from fbid_gym.robots.terrain import LEVELLED, TERRAINS, make_terrain, world_of
from fbid_gym.runtime.config import EnvConfig
from tests.pairs import pairs
from tests.robots.test_robot_errors import GOOD

ROUGH = ("obstacles", "rocks")
QUADRUPED = Path(__file__).parents[2] / "assets" / "quadruped.xml"
FEET = ["front_left_foot", "front_right_foot", "hind_left_foot", "hind_right_foot"]


@pytest.mark.parametrize(
    ("name", "robot"),
    [*((n, "quadruped") for n in ("flat", *ROUGH)), *pairs(LEVELLED, ["go1", "biped"], 1)],
)
def test_the_height_is_what_a_ray_from_above_hits(name: str, robot: str) -> None:
    owner = load(robot)
    given = {"difficulty": 0.9} if name in LEVELLED else {}
    terrain = make_terrain(name, owner, seed=3, **given)
    model = world_of(owner, terrain).compile()
    data = mujoco.MjData(model)
    data.qpos[: owner.nq] = owner.home_qpos
    mujoco.mj_forward(model, data)
    half = 0.52 * terrain.tiles.edge if name in LEVELLED else 3.6  # beyond the edge, too
    places = np.random.default_rng(2).uniform(-half, half, (600, 2))
    static, hit = np.array([1, 0, 0, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    down, top, body = np.array([0.0, 0.0, -1.0]), 10.0, owner.base_body
    starts = np.column_stack([places, np.full(600, top)])
    found = [top - mujoco.mj_ray(model, data, at, down, static, 1, body, hit) for at in starts]
    told = terrain.height(places[:, 0], places[:, 1])
    np.testing.assert_allclose(told, found, atol=2e-6)
    assert told.max() > (0.03 if name in ROUGH else 0.01) or name == "flat"
    assert (told.min() == 0.0 and told.max() <= 0.04) or name in LEVELLED


@pytest.mark.parametrize("name", ROUGH)
def test_starts_are_level_and_the_rest_is_not(name: str) -> None:
    terrain = make_terrain(name, load("quadruped"))
    angle, share = np.meshgrid(np.linspace(0, 2 * np.pi, 40), np.linspace(0, 0.99, 12))
    ring = terrain.clearing * share[..., None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    around = terrain.starts[:, None, None] + ring
    assert len(terrain.starts) == 9 and terrain.clearing > 0.15
    assert not terrain.height(around[..., 0], around[..., 1]).any()
    places = np.random.default_rng(0).uniform(-2, 2, (5000, 2))
    covered = (terrain.height(*places.T) > 0).mean()
    assert covered > (0.1 if name == "obstacles" else 0.7)


@pytest.mark.parametrize("name", ROUGH)
def test_a_seed_decides_and_the_height_scales(name: str) -> None:
    robot = load("quadruped")
    places = np.random.default_rng(0).uniform(-2, 2, (2000, 2)).T
    one, same = (make_terrain(name, robot, seed=3).height(*places) for _ in range(2))
    assert np.array_equal(one, same)
    assert (make_terrain(name, robot, seed=4).height(*places) != one).any()
    assert make_terrain(name, robot, seed=3, height=0.02).height(*places).max() <= 0.02
    assert not make_terrain(name, robot, height=0.0).height(*places).any()


def test_planks_are_from_half_the_height_to_the_height() -> None:
    terrain = make_terrain("obstacles", load("quadruped"), height=0.04)
    places = np.random.default_rng(0).uniform(-3, 3, (5000, 2))
    found = terrain.height(*places.T)
    assert 0.02 <= found[found > 0].min() and found.max() <= 0.04


@pytest.mark.parametrize(("name", "robot"), pairs(TERRAINS, ["biped", "quadruped"], 1))
def test_the_robot_keeps_its_coordinates_and_stands_at_a_start(name: str, robot: str) -> None:
    owner = load(robot)
    terrain = make_terrain(name, owner)
    model = world_of(owner, terrain).compile()
    assert (model.nq, model.nv, model.nbody) == (owner.nq, owner.nv, owner.model.nbody)
    data = mujoco.MjData(model)
    data.qpos[:] = owner.home_qpos
    data.qpos[:2] += terrain.starts[-1]
    data.qpos[2] -= 1e-4
    mujoco.mj_forward(model, data)
    data.qpos[2] += terrain.height(*terrain.starts[-1])
    mujoco.mj_forward(model, data)
    # On the plane every point touches once; on a height field maybe several of its triangles.
    assert len(set(data.contact.geom.max(axis=1))) == owner.num_points
    assert data.ncon == owner.num_points or name in LEVELLED
    assert data.contact.dist.min() > -2e-4


def test_grounds_that_cannot_be_are_refused() -> None:
    for name, given, message in (
        ("rocks", {"height": -0.01}, r"Invalid terrain height: .* metres from 0 to 0\.\d+, .*"),
        ("rocks", {"height": float("inf")}, r"Invalid terrain height: .* metres from 0 to 0\.\d+"),
        ("stairs", {"difficulty": float("nan")}, "Invalid difficulty: .* a number from 0 to 1"),
        ("stairs", {"difficulty": 1.1}, "Invalid difficulty: .* a number from 0 to 1"),
        ("sand", {}, "Unknown terrain 'sand'. Valid choices: flat, obstacles"),
    ):
        with pytest.raises(FbidError, match=message):
            make_terrain(name, load("quadruped"), **given)


LOW = GOOD.replace('pos="0 0 1"', 'pos="0 0 0"').replace(
    '<body name="thigh" pos="0 0 -0.2">', '<body name="thigh" pos="0 0 0.43">'
)


@pytest.mark.parametrize("name", TERRAINS)
def test_a_base_frame_near_the_soles_is_on_every_ground(name: str) -> None:
    """A frame may lie anywhere in a body; no height is given, so none is at fault."""
    text = LOW.replace('name="box" type="box"', 'name="box" type="box" pos="0 0 0.6"')
    config = EnvConfig(Robot.from_mjcf(text, ["toe", "toe2"]), terrain=name)
    assert abs(config.load_robot().home_qpos[2]) < 1e-9
    ground, _ = config.ground(config.load_robot())
    assert len(ground.starts) > 0


@pytest.mark.parametrize("name", LEVELLED)
def test_what_difficulty_decides_takes_no_height(name: str) -> None:
    message = rf"Invalid terrain_height: 0.0. Expected none on terrain '{name}', .* difficulty"
    with pytest.raises(FbidError, match=message):
        make_terrain(name, load("quadruped"), height=0.0)
    with pytest.raises(FbidError, match=message):
        EnvConfig(terrain=name, terrain_height=0.0)
    assert EnvConfig(terrain=name).resolved()["terrain_height"] is None


@pytest.mark.parametrize("kind", ["flat", "obstacles", "roughness"])
def test_what_is_added_is_as_mujoco_makes_it_and_meets_the_robot(kind: str) -> None:
    """Whatever the file's defaults say of its own geoms, and whichever bits these collide by."""
    usual = '<default><geom condim="1" friction="3" priority="2" group="4" margin="0.1"/>'
    text = QUADRUPED.read_text().replace("<default>", usual, 1)
    text = text.replace('contype="0" conaffinity="1"', 'contype="0" conaffinity="4"')
    robot = Robot.from_mjcf(text, FEET)
    terrain = make_terrain(kind, robot, **{"height": 0.03} if kind == "obstacles" else {})
    world = world_of(robot, terrain).compile()
    static = np.flatnonzero(world.body_weldid[world.geom_bodyid] == 0)
    assert len(static) > (kind != "flat")
    np.testing.assert_array_equal(world.geom_condim[static], 3)
    np.testing.assert_array_equal(world.geom_friction[static, 0], 1.0)
    assert not world.geom_priority[static].any() and not world.geom_margin[static].any()
    assert (world.geom_contype[static] & 4).all()


@pytest.mark.parametrize("name", ["obstacles", "rocks"])
def test_terrain_for_a_robot_above_its_only_point(name: str) -> None:
    text = """<mujoco><worldbody><body name="trunk" pos="0 0 1"><freejoint/><geom size="0.1"/>
      <body><joint name="knee" axis="0 1 0" range="-1 1"/>
        <geom name="toe" size="0.03" pos="0 0 -0.5"/></body></body></worldbody></mujoco>"""
    hopper = Robot.from_mjcf(text, ["toe"], torque_limit=10)
    terrain = make_terrain(name, hopper, height=0.02)
    assert terrain.clearing > 0.0
    line = np.linspace(-1.0, 1.0, 101)
    assert terrain.height(*np.meshgrid(line, line)).max() > 0.005
    world_of(hopper, terrain).compile()
