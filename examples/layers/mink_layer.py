"""Task-space PD by mink as an action layer: differential inverse kinematics, then joint PD.

Needs the package `mink`: pip install 'fbid_gym[layers]'. It knows where feet and body are, and
neither mass nor force but for the constant torques that hold the robot at home. The action moves
the feet's targets.
"""

from typing import Annotated

import mink
import mujoco
import numpy as np

from fbid_gym.actions import register_layer
from fbid_gym.actions.joint_gains import JointGains, holding_torque
from fbid_gym.actions.ranges import Falling
from fbid_gym.dynamics import frames
from fbid_gym.options import Number, checked


class PlaceTask(mink.Task):
    """Bring a point of a body, and perhaps its axes, to a place: world axes, (3,) or (6,)."""

    def __init__(self, body, cost):
        """Set up; `cost` has an entry for each of the error."""
        super().__init__(cost=np.asarray(cost, float), gain=1.0, lm_damping=0.0)
        self.body, self.size, self.point = body, len(cost), np.zeros(3)
        self.error = np.zeros(self.size)

    def compute_error(self, configuration):
        return self.error

    def compute_jacobian(self, configuration):
        size = configuration.model.nv
        moved, turned = np.zeros((3, size)), np.zeros((3, size))
        model, data = configuration.model, configuration.data
        mujoco.mj_jac(model, data, moved, turned, self.point, self.body)
        return np.vstack([moved, turned])[: self.size]


class TaskSpacePD:
    """tau = hold + K_D (v - qdot), v such that all reach their targets within K_D / K_P."""

    diagnostics = ()

    def __init__(self, robot, gains, scale, turn):
        """Set up a task for the body and each foot, and limits of the joints."""
        self.robot, self.gains, self.scale = robot, gains, scale
        self.hold, self.seconds = holding_torque(robot), (gains.damping / gains.stiffness).mean()
        self.configuration = mink.Configuration(robot.model)
        self.body = PlaceTask(robot.base_body, [1.0] * 3 + [turn] * 3)
        sizes = [3 if foot.num_points == 1 else 6 for foot in robot.feet]
        cost = [10.0] * 3 + [10.0 * turn] * 3  # feet go first
        feet = zip(robot.feet, sizes, strict=True)
        self.feet = [PlaceTask(foot.body, cost[:size]) for foot, size in feet]
        self.posture = mink.PostureTask(robot.model, cost=1e-2 * turn)
        self.limits = [mink.ConfigurationLimit(robot.model)]

    @property
    def action_names(self):
        names = [f"target of {foot}, {axis}" for foot in self.robot.foot_names for axis in "xyz"]
        return tuple(f"{name} (x {self.scale:.3g} m)" for name in names)

    def memory(self, num_robots):
        return {}

    def torque(self, action, state, target, terms, memory):
        known, result = terms(), np.empty((len(action), self.robot.num_joints))
        moved = self.scale * action.reshape(len(action), -1, 3)
        turned = frames.quaternion_to_matrix(target.qpos[:, 3:7])
        for i in range(len(action)):
            speed = np.append(target.qvel[i, :3], turned[i] @ target.qvel[i, 3:6])
            place = known.base_position[i], known.world_from_base[i]
            self._aim(self.body, place, (target.qpos[i, :3], turned[i]), speed)
            for k, task in enumerate(self.feet):
                place = known.foot_position[i, k], known.world_from_foot[i, k]
                if target.planted[i, k]:  # stays where it is
                    self._aim(task, place, (place[0] + moved[i, k], place[1]), np.zeros(6))
                    continue
                goal = target.foot_position[i, k] + moved[i, k], target.world_from_foot[i, k]
                self._aim(task, place, goal, target.foot_velocity[i, k])
            self.configuration.update(state.qpos[i])
            self.posture.set_target(target.qpos[i])
            tasks = [self.body, *self.feet, self.posture]
            v = mink.solve_ik(
                self.configuration, tasks, self.seconds, "daqp",
                damping=1e-6, limits=self.limits, safety_break=False,
            )  # fmt: skip
            result[i] = self.hold + self.gains.damping * (v[6:] - state.qvel[i, 6:])
        return result

    def _aim(self, task, now, goal, speed):
        """Tell a task what is left to its goal once that has moved on by its speed."""
        left = np.append(now[0] - goal[0], frames.rotation_vector(now[1] @ goal[1].T))
        task.point, task.error = now[0], (left - self.seconds * speed)[: task.size]


@checked
def task_space_pd(
    robot, control_hz, kind, *,
    natural_frequency: Annotated[float, Number(0.1, 100.0)] = 3.4,
    damping_ratio: Annotated[float, Number(0.1, 10.0)] = 1.0,
):  # fmt: skip
    """Build the layer: joints as firm as those of `joint_position`, in units of how it falls."""
    gains = JointGains.of(robot, control_hz, Falling(natural_frequency), damping_ratio)
    height = robot.home_qpos[2]
    return TaskSpacePD(robot, gains, 0.1 * height, height)


register_layer("mink", task_space_pd)
