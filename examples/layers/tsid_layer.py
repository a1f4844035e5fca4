"""TSID as an action layer: a QP over accelerations and contact forces, solved for each robot.

Needs the package `tsid`, see docs/layer_benchmark.md. References and gains are those that our own
`base_acceleration` has; what differs is the law: here all but friction cones and motors' limits is
a weighted square (A. Del Prete et al., "Implementing torque control with high-ratio gear boxes and
without joint-torque sensors", 2016, describes the library).
"""

import warnings
from typing import Annotated, Any

import numpy as np
import pinocchio as pin

with warnings.catch_warnings():
    warnings.simplefilter("ignore", RuntimeWarning)  # converters that it registers twice
    import tsid

from fbid_gym.actions import register_layer
from fbid_gym.actions.base_acceleration import action_scale
from fbid_gym.actions.gains import default_gains
from fbid_gym.actions.layer import scaled_names
from fbid_gym.dynamics import PinocchioDynamics, frames
from fbid_gym.dynamics.stance import Stance
from fbid_gym.errors import RobotError
from fbid_gym.options import Number, checked

FRICTION, STANDS = 0.6, 1e3
UP = np.array([0.0, 0.0, 1.0])
TURN, MOVE = np.array([0, 0, 0, 1, 1, 1.0]), np.array([1, 1, 1, 0, 0, 0.0])


class Problem:
    """The QP of robots whose feet stand or swing in one way; F feet."""

    def __init__(self, robot, model, gains, weights, stands):
        """Set up tasks and contacts; `stands` (F,) bool."""
        self.wrapper = wrapper = tsid.RobotWrapper(model, tsid.FLOATING_BASE_SYSTEM, False)
        self.qp = tsid.InverseDynamicsFormulationAccForce("tsid", wrapper, False)
        self.qp.computeProblemData(0.0, pin.neutral(model), np.zeros(model.nv))
        self.solver = tsid.SolverHQuadProgFast("solver")
        turn, feet, posture, forces = weights
        self.com = tsid.TaskComEquality("com", wrapper)
        self.com.setKp(np.array([gains.balance, gains.balance, gains.height]))
        damping = [gains.balance_damping, gains.balance_damping, gains.height_damping]
        self.com.setKd(np.array(damping))
        self.qp.addMotionTask(self.com, 1.0, 1, 0.0)
        base = model.frames[robot.base_body].name
        self.base = self._placed("base", base, gains.rotation, gains.rotation_damping, TURN)
        self.qp.addMotionTask(self.base, turn, 1, 0.0)
        self.joints = tsid.TaskJointPosture("joints", wrapper)
        ones = np.ones(robot.num_joints)
        self.joints.setKp(max(gains.posture, 1.0) * ones)
        self.joints.setKd(gains.posture_damping * ones)
        self.qp.addMotionTask(self.joints, posture, 1, 0.0)
        self.limits = tsid.TaskActuationBounds("motors", wrapper)
        self.limits.setBounds(-robot.torque_limit, robot.torque_limit)
        self.qp.addActuationTask(self.limits, 1.0, 0, 0.0)
        self.feet = []
        for k, foot in enumerate(robot.feet):
            name, least, most = f"sole {k}", 0.0, 4.0 * robot.weight
            if not stands[k]:
                mask = MOVE if foot.num_points == 1 else np.ones(6)
                task = self._placed(name, name, gains.swing, gains.swing_damping, mask)
                self.qp.addMotionTask(task, feet, 1, 0.0)
                self.feet.append(task)
                continue
            if foot.num_points == 1:
                contact = tsid.ContactPoint(name, wrapper, name, UP, FRICTION, least, most)
                contact.useLocalFrame(False)
                size = 3
            else:
                points = (foot.points - foot.points.mean(axis=0)).T
                contact = tsid.Contact6d(name, wrapper, name, points, UP, FRICTION, least, most)
                size = 6
            contact.setKp(np.zeros(size))  # where a foot stands it stays
            contact.setKd(gains.swing_damping * np.ones(size))
            # As constraints, on a straight leg they leave no solution, and the solver never ends.
            self.qp.addRigidContact(contact, forces, STANDS, 1)
            self.feet.append(contact)
        qp = self.qp
        self.solver.resize(qp.nVar, qp.nEq, qp.nIn)

    def _placed(self, name, frame, stiffness, damping, mask):
        task = tsid.TaskSE3Equality(name, self.wrapper, frame)
        task.setMask(mask)
        task.setKp(stiffness * np.ones(6))
        task.setKd(damping * np.ones(6))
        return task

    def solve(self, q, v):
        """Return the joints' torques (n,) N·m; None where there are none."""
        found = self.solver.solve(self.qp.computeProblemData(0.0, q, v))
        return self.qp.getActuatorForces(found) if found.status == 0 else None


def sample(position, velocity, acceleration):
    """Return a reference of a task."""
    made = tsid.TrajectorySample(len(position), len(velocity))
    made.value(position)
    made.derivative(velocity)
    made.second_derivative(acceleration)
    return made


def placement(rotation, position):
    """Return a placement as TSID takes it: (12,), the rotation column by column."""
    return np.concatenate([position, rotation.T.ravel()])


class TaskSpaceInverseDynamics:
    """The layer; the action is an acceleration of the body, as that of `base_acceleration`."""

    diagnostics = ("infeasible",)

    def __init__(self, robot, kind, weights):
        """Set up the model, with a frame at the sole of each foot."""
        if any(foot.num_points not in (1, 4) for foot in robot.feet):
            raise RobotError("TSID's feet have one contact point or four.")
        self.robot, self.weights = robot, weights
        self.gains, self.stance = default_gains(robot, kind), Stance.of(robot)
        self.scale = action_scale(robot, self.stance, FRICTION)
        self.model, home = PinocchioDynamics(robot).model, self.stance.terms.world_from_foot[0]
        for k, foot in enumerate(robot.feet):
            body = self.model.frames[foot.body]
            low = foot.points.mean(axis=0) - foot.radius * home[k].T @ UP
            place = body.placement * pin.SE3(np.eye(3), low)
            frame = pin.Frame(f"sole {k}", body.parentJoint, foot.body, place, body.type)
            self.model.addFrame(frame, False)
        self.problems: dict[bytes, Any] = {}

    @property
    def action_names(self):
        names = [f"acceleration {axis}" for axis in ("ahead", "to the left", "up")]
        names += [f"angular acceleration {axis}" for axis in "xyz"]
        return scaled_names(names, self.scale, "m/s^2", "rad/s^2")

    def memory(self, num_robots):
        return {"infeasible": np.zeros(num_robots)}

    def torque(self, action, state, target, terms, memory):
        known, robot = terms(), self.robot
        turned = frames.quaternion_to_matrix(target.qpos[:, 3:7])
        rotation = known.world_from_base
        q = frames.configuration_to_pinocchio(state.qpos, robot.model.qpos0)
        v = frames.velocity_to_pinocchio(state.qvel, rotation)
        joints = target.qpos[:, 7:] - robot.model.qpos0[7:]
        added, result = self.scale * action, np.empty((len(q), robot.num_joints))
        added[:, :3] = np.einsum("nij,nj->ni", known.world_from_trunk, added[:, :3])
        for i in range(len(q)):
            problem = self._problem(target.planted[i])
            # Of the height, that of the base counts: the centre of mass is to move as it does.
            com, speed = target.com[i].copy(), target.com_velocity[i].copy()
            rise = target.com_acceleration[i] + added[i, :3]
            com[2] = known.com[i, 2] + target.qpos[i, 2] - state.qpos[i, 2]
            speed[2] = known.com_velocity[i, 2] + target.qvel[i, 2] - state.qvel[i, 2]
            problem.com.setReference(sample(com, speed, rise))
            spin = np.append(np.zeros(3), turned[i] @ target.qvel[i, 3:6])
            angular = turned[i] @ target.qacc[i, 3:6] + rotation[i] @ added[i, 3:]
            place = placement(turned[i], state.qpos[i, :3])
            problem.base.setReference(sample(place, spin, np.append(np.zeros(3), angular)))
            its = joints[i], target.qvel[i, 6:], target.qacc[i, 6:]
            problem.joints.setReference(sample(*its))
            for k, foot in enumerate(problem.feet):
                point, stands = robot.feet[k].num_points == 1, target.planted[i, k]
                free = stands or point  # it may turn, or stays as it is
                axes = known.world_from_foot[i, k] if free else target.world_from_foot[i, k]
                if stands:
                    foot.setReference(pin.SE3(axes, known.foot_position[i, k]))
                    continue
                moves = target.foot_velocity[i, k], target.foot_acceleration[i, k]
                foot.setReference(sample(placement(axes, target.foot_position[i, k]), *moves))
            found = problem.solve(q[i], v[i])
            memory["infeasible"][i] = found is None
            result[i] = known.bias[i, 6:] if found is None else found
        return result

    def _problem(self, planted):
        key = planted.tobytes()
        if key not in self.problems:
            own = self.robot, self.model, self.gains, self.weights, planted
            self.problems[key] = Problem(*own)
        return self.problems[key]


Weight = Annotated[float, Number(0.0, 1e6)]


@checked
def task_space_inverse_dynamics(
    robot, control_hz, kind, *,
    turn: Weight = 1.0, feet: Weight = 1.0, posture: Weight = 1e-3, forces: Weight = 1e-4,
):  # fmt: skip
    """Build the layer from weights of its tasks, beside one for the centre of mass.

    Of angles they are times the squared height of the centre of mass, of forces over squared mass.
    """
    area = Stance.of(robot).home_com[2] ** 2
    weights = turn * area, feet, posture * area, forces / robot.mass**2
    return TaskSpaceInverseDynamics(robot, kind, weights)


register_layer("tsid", task_space_inverse_dynamics)
