"""The zoo's robots are what they were drawn to be, and stand."""

from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from eval import zoo
from fbid_gym.robots import Robot
from tests.pairs import pairs

SEEDS = range(26, 38)  # of every kind, as a test below says


@pytest.fixture(params=SEEDS)
def animal(request: pytest.FixtureRequest) -> zoo.Morphology:
    return zoo.draw(request.param)


def in_reference_pose(animal: zoo.Morphology) -> tuple[mujoco.MjModel, mujoco.MjData]:
    model = mujoco.MjModel.from_xml_string(zoo.mjcf(animal))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def lowest_points(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> np.ndarray:
    """(P, 3) m, world: where a foot's shape touches level ground."""
    size, rotation = model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)
    kind = mujoco.mjtGeom(model.geom_type[geom])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        corners = np.array([[x, y, -1.0] for x in (-1.0, 1.0) for y in (-1.0, 1.0)]) * size
        return data.geom_xpos[geom] + corners @ rotation.T
    half = size[1] if kind == mujoco.mjtGeom.mjGEOM_CAPSULE else 0.0
    ends = np.array([[0.0, 0.0, half], [0.0, 0.0, -half]]) @ rotation.T
    return data.geom_xpos[geom] + ends - [0.0, 0.0, size[0]]


def test_the_same_seed_draws_the_same_robot() -> None:
    assert zoo.zoo(3) == zoo.zoo(3) != zoo.zoo(4)


def test_the_zoo_is_diverse() -> None:
    animals = [zoo.draw(seed) for seed in SEEDS]
    assert {animal.legs for animal in animals} == {2, 4, 6}
    assert {animal.joints for animal in animals} == {3, 4, 5, 6, 7}
    assert {animal.foot for animal in animals} == set(zoo.FEET)
    assert {animal.actuators for animal in animals} == set(zoo.ACTUATORS)
    assert {animal.ground for animal in animals} == {True, False}
    masses = [animal.mass for animal in animals]
    assert 1.0 <= min(masses) < 3.0 and 80.0 < max(masses) <= 200.0


def test_mass_joints_and_feet_are_as_drawn(animal: zoo.Morphology) -> None:
    model, _ = in_reference_pose(animal)
    assert model.body_mass.sum() == pytest.approx(animal.mass)
    assert model.nv == 6 + animal.legs * animal.joints
    assert model.nu == (0 if animal.actuators == "none" else model.nv - 6)
    assert [model.body(name).geomnum[0] for name in animal.foot_names] == [1] * animal.legs


def test_inertias_are_physical(animal: zoo.Morphology) -> None:
    """Positive, and no moment larger than the two others together."""
    model, data = in_reference_pose(animal)
    moments = np.sort(model.body_inertia[1:], axis=1)
    assert np.all(model.body_mass[1:] > 0.0) and np.all(moments > 0.0)
    assert np.all(moments[:, 0] + moments[:, 1] >= moments[:, 2] * (1.0 - 1e-9))
    matrix = np.empty((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    assert np.linalg.eigvalsh(matrix)[0] > 0.0
    np.testing.assert_allclose(matrix[:3, :3], animal.mass * np.eye(3), atol=1e-9 * animal.mass)


def test_it_stands_in_its_reference_pose(animal: zoo.Morphology) -> None:
    """Feet level on z = 0, nothing else lower, the centre of mass within their bounds."""
    model, data = in_reference_pose(animal)
    feet = [int(model.body(name).geomadr[0]) for name in animal.foot_names]
    points = np.concatenate([lowest_points(model, data, foot) for foot in feet])
    np.testing.assert_allclose(points[:, 2], 0.0, atol=1e-9)
    bodies = set(range(1, model.nbody)) - {int(model.geom_bodyid[foot]) for foot in feet}
    assert data.xpos[list(bodies), 2].min() > 0.05 * animal.leg
    low, high, com = points.min(axis=0), points.max(axis=0), data.subtree_com[1]
    spare = 0.1 * (high - low)
    assert np.all(low[:2] + spare[:2] < com[:2]) and np.all(com[:2] < high[:2] - spare[:2])


def test_feet_and_nothing_else_meet_a_floor_that_is_there(animal: zoo.Morphology) -> None:
    model, data = in_reference_pose(animal)
    data.qpos[2] -= 0.01 * animal.leg
    mujoco.mj_forward(model, data)
    feet = {model.body(name).id for name in animal.foot_names} if animal.ground else set()
    assert set(model.geom_bodyid[data.contact.geom].max(axis=1)) == feet


def load_animal(animal: zoo.Morphology, feet: Any = None, home: Any = None) -> Robot:
    limit = zoo.torque_limit(animal) if animal.actuators == "none" else None
    return Robot.from_mjcf(zoo.mjcf(animal), feet, home=home, torque_limit=limit)


def test_it_loads_as_drawn_by_the_bodies_of_its_feet(animal: zoo.Morphology) -> None:
    robot = load_animal(animal, animal.foot_names)
    assert robot.mass == pytest.approx(animal.mass)
    np.testing.assert_allclose(robot.torque_limit, zoo.torque_limit(animal))
    assert robot.home_qpos[2] == pytest.approx(robot.model.qpos0[2], abs=1e-9)
    assert robot.check() == []
    model, data = in_reference_pose(animal)
    for foot, name in zip(robot.feet, animal.foot_names, strict=True):
        assert foot.num_points == {"sphere": 1, "box": 4, "capsule": 2}[animal.foot]
        expected = lowest_points(model, data, int(model.body(name).geomadr[0]))
        rotation = data.body(name).xmat.reshape(3, 3)
        found = data.body(name).xpos + foot.points @ rotation.T - [0.0, 0.0, foot.radius]
        gap = np.linalg.norm(found[:, None] - expected, axis=-1)
        assert gap.min(axis=0).max() < 1e-9 and gap.min(axis=1).max() < 1e-9


def test_its_servos_gains_are_kept(animal: zoo.Morphology) -> None:
    gains = load_animal(animal).servo_gains
    if animal.actuators == "servo":
        assert gains is not None
        np.testing.assert_allclose(gains.stiffness, 4 * zoo.torque_limit(animal), rtol=1e-6)
    else:
        assert gains is None


def test_its_feet_are_found(animal: zoo.Morphology) -> None:
    assert load_animal(animal).foot_names == animal.foot_names


def test_a_standing_pose_is_found(animal: zoo.Morphology) -> None:
    """Level on the ground, within the joint ranges, nothing to say against it."""
    robot = load_animal(animal, animal.foot_names, home="stand")
    data = mujoco.MjData(robot.model)
    data.qpos[:] = robot.home_qpos
    mujoco.mj_forward(robot.model, data)
    points = np.concatenate(
        [
            data.xpos[foot.body] + foot.points @ data.xmat[foot.body].reshape(3, 3).T
            for foot in robot.feet
        ]
    )
    np.testing.assert_allclose(points[:, 2] - robot.feet[0].radius, 0.0, atol=1e-3 * animal.leg)
    off = data.subtree_com[robot.base_body] - points.mean(axis=0)
    assert np.linalg.norm(off[:2]) < 0.01 * animal.leg
    assert np.all(np.abs(robot.home_qpos[7:]) <= 1.2)
    assert robot.check() == []


@pytest.mark.parametrize(("seed", "sole"), pairs(SEEDS[::2], zoo.SOLES, 1))
def test_soles_of_other_shapes_stand_like_boxes(seed: int, sole: str) -> None:
    """On the same four corners, and so in the same pose."""
    drawn = zoo.draw(seed)
    boxes = load_animal(replace(drawn, foot="box"), drawn.foot_names, home="stand")
    robot = load_animal(replace(drawn, foot=sole), drawn.foot_names, home="stand")
    assert robot.check() == []
    assert [foot.num_points for foot in robot.feet] == [4] * drawn.legs
    for foot, box in zip(robot.feet, boxes.feet, strict=True):
        gap = np.linalg.norm(foot.points[:, None, :2] - box.points[:, :2], axis=-1)
        assert gap.min(axis=0).max() < 1e-4 * drawn.leg
    np.testing.assert_allclose(robot.home_qpos[7:], boxes.home_qpos[7:], atol=0.05)
