"""Your own action layer: the policy says with what force each foot pushes the ground."""

import argparse
from dataclasses import dataclass
from typing import Annotated

import gymnasium as gym
import numpy as np

from fbid_gym.actions import register_layer
from fbid_gym.actions.joint_gains import JointGains
from fbid_gym.actions.ranges import Falling
from fbid_gym.options import Number, checked
from fbid_gym.robots import Robot


@dataclass(frozen=True, eq=False)
class FootForce:
    """tau = (h - sum of J^T f)_joints + soft PD; at a zero action the feet share the weight."""

    robot: Robot
    gains: JointGains
    scale: float
    diagnostics = ()

    @property
    def action_names(self):
        names = [f"force of {foot}, {axis}" for foot in self.robot.foot_names for axis in "xyz"]
        return tuple(f"{name} (x {self.scale:g} weight)" for name in names)

    def memory(self, num_robots):
        return {}

    def torque(self, action, state, target, terms, memory):
        known = terms()
        force = self.scale * self.robot.weight * action.reshape(len(action), -1, 3)
        force[:, :, 2] += self.robot.weight / self.robot.num_feet
        pushed = np.einsum("nfkv,nfk->nv", known.foot_jacobian[:, :, :3], force)
        error = target.qpos[:, 7:] - state.qpos[:, 7:]
        rate = target.qvel[:, 6:] - state.qvel[:, 6:]
        feedback = self.gains.stiffness * error + self.gains.damping * rate
        return (known.bias - pushed)[:, 6:] + feedback


@checked
def foot_force(robot, control_hz, kind, *, scale: Annotated[float, Number(0, 2)] = 0.5):
    """Build the layer; its options are keyword-only arguments, here with the range of each."""
    return FootForce(robot, JointGains.of(robot, control_hz, Falling(1.0), 1.0), scale)


register_layer("foot_force", foot_force)

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=250)
    envs = gym.make_vec("fbid_gym/QuadrupedBalance-v0", num_envs=8, action_layer="foot_force")
    envs.reset(seed=0)
    for _ in range(parser.parse_args().steps):
        _, rewards, fallen, *_ = envs.step(np.zeros(envs.action_space.shape))
    print(f"mean reward {rewards.mean():.2f}, {fallen.sum()} of {len(fallen)} fall")
