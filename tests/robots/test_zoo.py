"""The zoo's robots are what they were drawn to be, and stand."""

import re
from dataclasses import replace
from typing import Any

import mujoco
import numpy as np
import pytest

from fbid_gym.robots import Robot, zoo
from tests.pairs import pairs
from tests.postures import points, posed

SEEDS = range(26, 38)  # all numbers of legs and joints, all feet and actuators


# Humanoids of five and six joints a leg, with motors and servos.
@pytest.fixture(params=[*SEEDS, "humanoid:0", "humanoid:1", "humanoid:4"])
def animal(request: pytest.FixtureRequest) -> zoo.Morphology:
    family, _, seed = str(request.param).rpartition(":")
    return zoo.draw(int(seed), family)


def torque_limits(animal: zoo.Morphology) -> list[float]:
    """N·m, of each joint."""
    return [zoo.torque_limit(animal, name) for name in animal.legs * animal.joint_names]


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


def test_knees_go_from_straight_to_folded(animal: zoo.Morphology) -> None:
    """No further: a leg does not bend the other way."""
    model, data = in_reference_pose(animal)
    knees = [model.joint(f"leg{leg}_knee") for leg in range(animal.legs)]
    for end, angle in enumerate((0.0, 2.75)):
        for leg, knee in enumerate(knees):
            ahead = animal.knees[leg // 2] > 0  # its least angle is the straight one
            data.qpos[knee.qposadr] = knee.range[end if ahead else 1 - end]
        mujoco.mj_kinematics(model, data)
        for leg, knee in enumerate(knees):
            upper = data.body(f"leg{leg}_lower").xpos - data.body(f"leg{leg}_upper").xpos
            lower = data.body(f"foot{leg}").xpos - data.xanchor[knee.id]
            cosine = upper @ lower / np.linalg.norm(upper) / np.linalg.norm(lower)
            assert np.arccos(min(cosine, 1.0)) == pytest.approx(angle, abs=1e-6)


def test_humanoids_are_as_those_that_one_can_buy() -> None:
    animals = [zoo.draw(seed, "humanoid") for seed in range(40)]
    assert {len(animal.joint_names) for animal in animals} == {5, 6}
    assert {"hip_yaw", "ankle_pitch"} <= set(animals[0].joint_names) and animals[0].joints == 5
    heights, weak = [], []
    for animal in animals:
        model, data = in_reference_pose(animal)
        heights.append(data.subtree_com[1, 2] / animal.leg)
        limits = torque_limits(animal)
        weak.append(min(limits) / (animal.mass * 9.81 * animal.leg))
        assert model.body_mass.sum() == pytest.approx(animal.mass)
    assert 1.0 < min(heights) and max(heights) < 1.3
    assert 0.1 <= min(weak) and max(weak) < 0.37


def load_animal(animal: zoo.Morphology, feet: Any = None, home: Any = None) -> Robot:
    limit = zoo.torque_limit(animal) if animal.actuators == "none" else None
    return Robot.from_mjcf(zoo.mjcf(animal), feet, home=home, torque_limit=limit)


def test_it_loads_as_drawn_by_the_bodies_of_its_feet(animal: zoo.Morphology) -> None:
    robot = load_animal(animal, animal.foot_names)
    assert robot.mass == pytest.approx(animal.mass)
    np.testing.assert_allclose(robot.torque_limit, torque_limits(animal))
    lowered = robot.model.qpos0[2] - robot.home_qpos[2]  # straight legs bend to stand
    assert abs(lowered) < 1e-9 or (animal.family and 0.0 < lowered < 0.1 * animal.leg)
    assert robot.check() == []
    model, data = in_reference_pose(animal)
    for foot, name in zip(robot.feet, animal.foot_names, strict=True):
        assert foot.num_points == {"sphere": 1, "box": 4, "capsule": 2}[animal.foot]
        expected = lowest_points(model, data, int(model.body(name).geomadr[0]))
        rotation = data.body(name).xmat.reshape(3, 3)
        found = data.body(name).xpos + foot.points @ rotation.T - [0.0, 0.0, foot.radius]
        gap = np.linalg.norm(found[:, None] - expected, axis=-1)
        assert gap.min(axis=0).max() < 1e-9 and gap.min(axis=1).max() < 1e-9


def test_its_feet_are_found_and_its_servos_gains_kept(animal: zoo.Morphology) -> None:
    robot = load_animal(animal)
    assert robot.foot_names == animal.foot_names
    assert (robot.servo_gains is not None) == (animal.actuators == "servo")
    if robot.servo_gains is not None:
        stiffness = 4 * np.array(torque_limits(animal))
        np.testing.assert_allclose(robot.servo_gains.stiffness, stiffness, rtol=1e-6)


@pytest.mark.slow
def test_a_standing_pose_is_found(animal: zoo.Morphology) -> None:
    """Level on the ground, within the joint ranges, nothing to say against it."""
    robot = load_animal(animal, animal.foot_names, home="stand")
    data = posed(robot)
    touching = points(robot, data)
    np.testing.assert_allclose(touching[:, 2], 0.0, atol=1e-3 * animal.leg)
    off = data.subtree_com[robot.base_body] - touching.mean(axis=0)
    assert np.linalg.norm(off[:2]) < 0.01 * animal.leg
    low, high = robot.joint_range.T
    assert np.all((low <= robot.home_qpos[7:]) & (robot.home_qpos[7:] <= high))
    assert robot.check() == []


def on_soles(animal: zoo.Morphology, sole: str) -> str:
    """An animal's MJCF with rounded soles or small spheres instead of boxes, on their corners."""
    down, half, small = 0.1 * animal.leg, animal.leg * np.array([0.14, 0.07]), 0.01 * animal.leg
    places = half * [[x, y] for x in (-1.0, 0.0, 1.0) for y in (-1.0, 0.0, 1.0)]
    angle = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    rim = 0.8 * half * np.column_stack([np.cos(angle), np.sin(angle)])
    vertices = np.insert(np.concatenate([places[[0, 2, 6, 8]], rim]), 2, -0.5 * down, axis=1)
    vertices[:4, 2] = -down
    asset = f'<asset><mesh name="sole" vertex="{" ".join(map(str, vertices.ravel()))}"/></asset>'
    spheres = [f'type="sphere" size="{small}" pos="{x} {y} {small - down}"' for x, y in places]
    shapes = spheres if sole == "spheres" else ['type="mesh" mesh="sole"']
    feet = "".join(f'<geom {shape} mass="{{}}"{{}}/>' for shape in shapes)
    box = re.compile(r'<geom type="box" size="[^"]*" pos="[^"]*" mass="([^"]*)"([^/]*)/>')
    text = zoo.mjcf(replace(animal, foot="box")).replace("<worldbody>", f"{asset}<worldbody>")
    each = len(shapes)
    return box.sub(lambda foot: feet.format(*[float(foot[1]) / each, foot[2]] * each), text)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "sole"), pairs(SEEDS[::2], ("mesh", "spheres"), 1))
def test_soles_of_other_shapes_stand_like_boxes(seed: int, sole: str) -> None:
    """On the same four corners, and so in the same pose."""
    drawn = zoo.draw(seed)
    boxes = load_animal(replace(drawn, foot="box"), drawn.foot_names, home="stand")
    limit = zoo.torque_limit(drawn)
    own = on_soles(drawn, sole)
    robot = Robot.from_mjcf(own, drawn.foot_names, home="stand", torque_limit=limit)
    assert robot.check() == []
    assert [foot.num_points for foot in robot.feet] == [4] * drawn.legs
    for foot, box in zip(robot.feet, boxes.feet, strict=True):
        gap = np.linalg.norm(foot.points[:, None, :2] - box.points[:, :2], axis=-1)
        assert gap.min(axis=0).max() < 1e-4 * drawn.leg
    np.testing.assert_allclose(robot.home_qpos[7:], boxes.home_qpos[7:], atol=0.05)
