"""Models and states on which the providers of dynamics are compared."""

from collections.abc import Callable
from pathlib import Path

import gymnasium
import mujoco
import numpy as np

from fbid_gym.robots import Robot, load

ASSETS = Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets"
RANDOM_FEET = {"flat": [f"corner{index}" for index in range(4)], "ball": ["ball"]}
GYMNASIUM = {
    "gymnasium humanoid": ("humanoid.xml", ["left_foot", "right_foot"]),
    "ant": ("ant.xml", [f"{leg}_ankle_geom" for leg in ("left", "right", "third", "fourth")]),
}


def robot_called(name: str | int) -> Robot:
    """A robot of ours or of Gymnasium's by its name, or a random tree by its seed."""
    if isinstance(name, int):
        return Robot.from_mjcf(random_mjcf(name), RANDOM_FEET)
    if name in GYMNASIUM:
        file, feet = GYMNASIUM[name]
        return Robot.from_mjcf(ASSETS / file, feet)
    return load(name)


def _numbers(values: np.ndarray) -> str:
    return " ".join(f"{value:.17g}" for value in np.atleast_1d(values))


def random_mjcf(seed: int) -> str:
    """A floating-base tree with everything that a conversion between libraries can get wrong.

    Hinges and slides with `ref` and a `pos` of their own, zero to three of them on a body, bodies
    and inertial frames turned at random, armature on joints and (on odd seeds) on the free joint,
    tilted gravity, and a static tree before the robot so that its root is not the
    first body. Every joint has a motor. A foot of four sites and a spherical one, on bodies far
    from the root, are named `corner0` … `corner3` and `ball`.
    """
    rng = np.random.default_rng(seed)
    motors = []

    def frame() -> str:
        position, quaternion = rng.normal(size=3) * 0.3, rng.normal(size=4)
        return f'pos="{_numbers(position)}" quat="{_numbers(quaternion)}"'

    def inertial() -> str:
        # Principal moments of an ellipsoid: they satisfy the triangle inequality.
        mass, axes = rng.uniform(0.2, 3.0), rng.uniform(0.05, 0.3, size=3) ** 2
        moments = mass / 5 * (axes.sum() - axes)
        return f'<inertial {frame()} mass="{mass:.17g}" diaginertia="{_numbers(moments)}"/>'

    def joint(name: str) -> str:
        kind = "hinge" if rng.random() < 0.65 else "slide"
        gear = rng.uniform(1, 20)
        motors.append(f'<motor joint="{name}" gear="{gear:.17g}" ctrlrange="-3 3"/>')
        return (
            f'<joint name="{name}" type="{kind}" axis="{_numbers(rng.normal(size=3))}" '
            f'pos="{_numbers(rng.normal(size=3) * 0.2)}" ref="{rng.normal():.17g}" '
            f'armature="{rng.choice([0.0, rng.uniform(0, 0.5)]):.17g}" damping="0.1"/>'
        )

    num_bodies = int(rng.integers(4, 9))
    parent = [int(rng.integers(0, body)) if body else -1 for body in range(num_bodies)]
    # The last two bodies carry the feet; the last but one is made to move.
    num_joints = [0] + [int(rng.integers(0, 4)) for _ in range(num_bodies - 1)]
    num_joints[-1], num_joints[-2] = max(num_joints[-1], 1), max(num_joints[-2], 1)

    def body(number: int) -> str:
        parts = [inertial()]
        if number == 0:
            armature = rng.uniform(0.1, 0.5) if seed % 2 else 0.0
            parts.append(f'<joint name="root" type="free" armature="{armature:.17g}"/>')
        parts += [joint(f"joint{number}_{index}") for index in range(num_joints[number])]
        if number == num_bodies - 1:
            corners = rng.normal(size=(4, 3)) * 0.1
            parts += [
                f'<site name="corner{index}" pos="{_numbers(corner)}"/>'
                for index, corner in enumerate(corners)
            ]
        if number == num_bodies - 2:
            parts.append(
                f'<geom name="ball" size="0.04" pos="{_numbers(rng.normal(size=3) / 9)}"/>'
            )
        parts += [body(child) for child in range(num_bodies) if parent[child] == number]
        return f'<body name="body{number}" {frame()}>{"".join(parts)}</body>'

    robot = body(0)
    return f"""
    <mujoco model="random{seed}">
      <compiler angle="radian" inertiafromgeom="false"/>
      <option gravity="{_numbers(rng.normal(size=3) * 6)}" jacobian="dense"/>
      <worldbody>
        <geom name="floor" type="plane" size="10 10 0.1"/>
        <body name="post" {frame()}>
          <inertial pos="0 0 1" mass="40" diaginertia="1 1 1"/>
          <body name="plate" {frame()}><geom size="0.1" contype="0" conaffinity="0"/></body>
        </body>
        {robot}
      </worldbody>
      <actuator>{"".join(motors)}</actuator>
    </mujoco>"""


def random_states(
    model: mujoco.MjModel, count: int, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """States (count, nq), (count, nv) far from rest: any attitude, large angles and velocities."""
    rng = np.random.default_rng([seed, model.nq])
    qpos = rng.normal(size=(count, model.nq))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    return qpos, 2.0 * rng.normal(size=(count, model.nv))


def relative_error(actual: np.ndarray, expected: np.ndarray) -> float:
    """Largest deviation, relative to the largest entry expected."""
    return float(np.abs(actual - expected).max() / max(np.abs(expected).max(), 1e-3))


def assert_close(actual: np.ndarray, expected: np.ndarray, scale: np.ndarray | None = None) -> None:
    """Equal to 1e-9 of the largest entry expected, or of `scale`."""
    size = np.abs(expected if scale is None else scale).max()
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=1e-9 * size)


def rate(
    robot: Robot, qpos: np.ndarray, qvel: np.ndarray, quantity: Callable[..., np.ndarray]
) -> np.ndarray:
    """Rate of quantity(qpos, qvel) at constant qvel, by differences of sixth order."""
    step, path = 1e-3, []
    for k in range(-3, 4):
        there = qpos.copy()
        mujoco.mj_integratePos(robot.model, there, qvel, k * step)
        path.append(quantity(there, qvel))
    weights = np.array([-1, 9, -45, 0, 45, -9, 1]) / (60 * step)
    return np.tensordot(weights, path, axes=1)
