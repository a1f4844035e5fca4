"""Compensate springs, damping and friction of the joints."""

from typing import NamedTuple

import mujoco
import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.stance import Stance
from fbid_gym.robots import Robot

_SLIDE = mujoco.mjtJoint.mjJNT_SLIDE

# Of the robot's rate of falling. Where friction is overcome, joints slower than this keep a part of
# it: all of it at rest, so that a joint never moves by the sign of a rounding error.
_SLOW = 0.05


class PassiveJoints(NamedTuple):
    """Passive effects on the joints that a layer compensates; rad or m.

    Attributes:
        rest: (n,) where springs do not pull.
        spring: (3, n) N·m/rad, N·m/rad², N·m/rad³ of its polynomial.
        damping: (3, n) N·m·s/rad, of the velocity, and of its square and cube.
        friction: (n,) N·m of dry friction.
        steepness: (n,) s/rad; times the velocity the share of it that is given back, up to one.
    """

    rest: np.ndarray
    spring: np.ndarray
    damping: np.ndarray
    friction: np.ndarray
    steepness: np.ndarray

    @classmethod
    def of(cls, robot: Robot, *, damping: bool = True, friction: bool = False) -> "PassiveJoints":
        """Return those of a robot: its springs, and what else shall be given back."""
        model = robot.model
        joints = model.dof_jntid[6:]
        stance = Stance.of(robot)
        springs = np.vstack([model.jnt_stiffness, model.jnt_stiffnesspoly.T])[:, joints]
        lever = np.where(model.jnt_type[joints] == _SLIDE, stance.home_com[2], 1.0)
        return cls(
            rest=model.qpos_spring[7:].copy(),
            spring=np.ascontiguousarray(springs),
            damping=damping * np.array([model.dof_damping, *model.dof_dampingpoly.T])[:, 6:],
            friction=model.dof_frictionloss[6:] * friction,
            steepness=1.0 / (_SLOW * stance.falling_rate * lever),
        )


@compiled
def give_back(
    passive: PassiveJoints, torque: np.ndarray, qpos: np.ndarray, qvel: np.ndarray
) -> np.ndarray:
    """Add to torques (N, n) what passive joints take of them, in place; returns these torques."""
    spring, damping = passive.spring, passive.damping
    for i in range(len(torque)):
        for j in range(torque.shape[1]):
            place, velocity = qpos[i, 7 + j] - passive.rest[j], qvel[i, 6 + j]
            speed, sliding = abs(velocity), velocity * passive.steepness[j]
            torque[i, j] += (
                place * (spring[0, j] + place * (spring[1, j] + place * spring[2, j]))
                + velocity * (damping[0, j] + speed * (damping[1, j] + speed * damping[2, j]))
                + passive.friction[j] * min(max(sliding, -1.0), 1.0)
            )
    return torque
