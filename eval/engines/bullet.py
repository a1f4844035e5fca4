"""A robot in Bullet: built from its compiled MuJoCo model, moved by torques, sensed.

Bullet solves contacts by projected Gauss-Seidel on velocities: impulses, one after another, that
forbid penetration outright within friction pyramids. MuJoCo solves a convex problem in which
contacts give way like springs. Both integrate the same multibody dynamics.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import mujoco
import numpy as np

from fbid_gym.errors import FbidError, RobotError
from fbid_gym.robots import Robot

_SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
}
_ITERATIONS = 100  # of the contact solver


class _Link(NamedTuple):
    """A link as Bullet has it: one joint moves it."""

    parent: int  # index of the link before it; -1 is the base
    position: np.ndarray  # (3,) m, of its joint, in the parent's axes, from the parent's joint
    quaternion: np.ndarray  # (4,) wxyz, of its axes in the parent's
    joint: int  # of the model; -1: it is fixed
    body: int  # of the model whose mass and shapes it has; -1: it has none
    anchor: np.ndarray  # (3,) m, of the joint in the body's frame


class BulletWorld:
    """One robot on level ground.

    Its masses, inertias, joints, their damping, friction and limits, and the shapes that touch the
    ground with their friction are those of the model. Bullet knows no armature: the inertia of a
    motor's rotor is added to the link that it drives, about the joint's axis. There it is felt also
    when that link turns with the whole robot, which armature is not.
    """

    def __init__(self, robot: Robot, hz: int, *, armature: bool = True) -> None:
        """Build the world, with `hz` physics steps per second.

        Raises:
            FbidError: pybullet is not installed, or a robot with a joint or a contact shape that
                is not converted.
        """
        try:
            import pybullet
            from pybullet_utils.bullet_client import BulletClient
        except ModuleNotFoundError as error:
            raise FbidError(
                "Another physics engine needs pybullet, which is not installed. It comes with the "
                "extra 'bullet': pip install 'fbid_gym[bullet]'."
            ) from error
        self.robot, self.hz, model = robot, hz, robot.model
        self._engine = engine = BulletClient(pybullet.DIRECT)  # a world of its own
        engine.setGravity(0.0, 0.0, -robot.gravity)
        engine.setPhysicsEngineParameter(
            fixedTimeStep=1.0 / hz, numSolverIterations=_ITERATIONS, deterministicOverlappingPairs=1
        )
        self._ground = engine.createMultiBody(0.0, engine.createCollisionShape(engine.GEOM_PLANE))
        engine.changeDynamics(self._ground, -1, lateralFriction=1.0, restitution=0.0)
        links = list(_links(robot))
        inertias = [_inertia(model, link, armature) for link in links]
        base = _Link(-2, np.zeros(3), np.array([1.0, 0, 0, 0]), -1, robot.base_body, np.zeros(3))
        mass, place, axes, diagonal = _inertia(model, base, armature)
        self._inertial = place, axes
        turning = [link.joint for link in links]
        kinds = {-1: engine.JOINT_FIXED}
        kinds |= {j: _kind(engine, model, j) for j in turning if j >= 0}
        self._id = engine.createMultiBody(
            mass,
            self._shape(base),
            -1,
            [0.0, 0.0, 1.0],
            [0.0, 0.0, 0.0, 1.0],
            baseInertialFramePosition=place.tolist(),
            baseInertialFrameOrientation=_xyzw(axes),
            linkMasses=[inertia[0] for inertia in inertias],
            linkCollisionShapeIndices=[self._shape(link) for link in links],
            linkVisualShapeIndices=[-1] * len(links),
            linkPositions=[link.position.tolist() for link in links],
            linkOrientations=[_xyzw(link.quaternion) for link in links],
            linkInertialFramePositions=[inertia[1].tolist() for inertia in inertias],
            linkInertialFrameOrientations=[_xyzw(inertia[2]) for inertia in inertias],
            linkParentIndices=[link.parent + 1 for link in links],
            linkJointTypes=[kinds[joint] for joint in turning],
            linkJointAxis=[
                model.jnt_axis[joint].tolist() if joint >= 0 else [0.0, 0.0, 1.0]
                for joint in turning
            ],
        )
        for index, (link, inertia) in enumerate(
            zip([base, *links], [diagonal, *(inertia[3] for inertia in inertias)], strict=True), -1
        ):
            dof = model.jnt_dofadr[link.joint] if link.joint >= 0 else -1
            touching = _touching(model, link.body)
            changes = {
                "lateralFriction": max(model.geom_friction[touching, 0], default=1.0),
                "restitution": 0.0,
                "linearDamping": 0.0,
                "angularDamping": 0.0,
                "maxJointVelocity": 1e6,
                "activationState": engine.ACTIVATION_STATE_DISABLE_SLEEPING,
                "jointDamping": float(model.dof_damping[dof]) if dof >= 0 else 0.0,
                "localInertiaDiagonal": inertia.tolist(),
            }
            for change, value in changes.items():  # together, some of them are lost
                engine.changeDynamics(self._id, index, **{change: value})
            if link.joint >= 0 and model.jnt_limited[link.joint]:
                lower, upper = model.jnt_range[link.joint] - model.qpos0[dof + 1]
                engine.changeDynamics(self._id, index, jointLowerLimit=lower, jointUpperLimit=upper)
        self._joints = [turning.index(joint) for joint in _moving(model)]
        self._zero = model.qpos0[7:]
        for index, joint in zip(self._joints, _moving(model), strict=True):
            # a motor that holds still with no more than the joint's dry friction; none where none.
            dry = float(model.dof_frictionloss[model.jnt_dofadr[joint]])
            engine.setJointMotorControl2(
                self._id, index, engine.VELOCITY_CONTROL, targetVelocity=0.0, force=dry
            )
        bodies = [link.body for link in links]
        self._feet = {
            -1 if foot.body == robot.base_body else bodies.index(foot.body): k
            for k, foot in enumerate(robot.feet)
        }
        self._points = [
            points - (links[bodies.index(body)].anchor if body in bodies else 0.0)
            for body, points in ((foot.body, foot.points) for foot in robot.feet)
        ]
        self._first = np.cumsum([0, *(foot.num_points for foot in robot.feet)])

    def place(self, qpos: np.ndarray, qvel: np.ndarray) -> None:
        """Put the robot somewhere: qpos (nq,) and qvel (nv,), as MuJoCo has them."""
        place, axes = self._inertial
        base, rotation = qpos[3:7], _matrix(qpos[3:7])
        centre, turning = rotation @ place, rotation @ qvel[3:6]
        whole = np.zeros(4)
        mujoco.mju_mulQuat(whole, base, axes)
        engine = self._engine
        engine.resetBasePositionAndOrientation(self._id, (qpos[:3] + centre).tolist(), _xyzw(whole))
        linear = qvel[:3] + np.cross(turning, centre)
        engine.resetBaseVelocity(self._id, linear.tolist(), turning.tolist())
        values = zip(self._joints, qpos[7:] - self._zero, qvel[6:], strict=True)
        for index, position, velocity in values:
            engine.resetJointState(self._id, index, position, velocity)

    def step(self, torque: np.ndarray, push: np.ndarray) -> None:
        """Advance by a physics step: torques (n,) N·m, and a force (3,) N at the base's centre."""
        engine = self._engine
        engine.setJointMotorControlArray(
            self._id, self._joints, engine.TORQUE_CONTROL, forces=torque.tolist()
        )
        if push.any():
            centre, _ = engine.getBasePositionAndOrientation(self._id)
            engine.applyExternalForce(self._id, -1, push.tolist(), centre, engine.WORLD_FRAME)
        engine.stepSimulation()

    def state(self) -> tuple[np.ndarray, np.ndarray]:
        """Return qpos (nq,) and qvel (nv,), as MuJoCo has them."""
        place, axes = self._inertial
        engine = self._engine
        position, orientation = engine.getBasePositionAndOrientation(self._id)
        linear, angular = map(np.array, engine.getBaseVelocity(self._id))
        inverse, base = np.zeros(4), np.zeros(4)
        mujoco.mju_negQuat(inverse, axes)
        mujoco.mju_mulQuat(base, np.array(orientation)[[3, 0, 1, 2]], inverse)
        rotation = _matrix(base)
        centre = rotation @ place
        joints = np.array([s[:2] for s in engine.getJointStates(self._id, self._joints)])
        return (
            np.concatenate([np.array(position) - centre, base, joints[:, 0] + self._zero]),
            np.concatenate(
                [linear - np.cross(angular, centre), rotation.T @ angular, joints[:, 1]]
            ),
        )

    def contact_force(self) -> np.ndarray:
        """Return the force of the ground on each contact point, (P, 3) N, in the last step."""
        force = np.zeros((self.robot.num_points, 3))
        for contact in self._engine.getContactPoints(self._id, self._ground):
            foot = self._feet.get(contact[3])
            if foot is None:
                continue
            axes = np.array([contact[7], contact[11], contact[13]])
            found = np.array([contact[9], contact[10], contact[12]]) @ axes
            points = self._points[foot]
            nearest = 0
            if len(points) > 1:
                state = self._engine.getLinkState(self._id, contact[3])
                rotation = _matrix(np.array(state[5])[[3, 0, 1, 2]])
                seen = (np.array(contact[5]) - state[4]) @ rotation
                nearest = int(np.linalg.norm(points - seen, axis=1).argmin())
            force[self._first[foot] + nearest] += found
        return force

    def sensors(self) -> dict[str, np.ndarray]:
        """Return what `fbid_gym.runtime.SENSORS` names, without errors."""
        qpos, qvel = self.state()
        return {
            "position": qpos[:3],
            "orientation": qpos[3:7],
            "velocity": qvel[:3],
            "angular_velocity": qvel[3:6],
            "joint_position": qpos[7:],
            "joint_velocity": qvel[6:],
            "contact_force": self.contact_force(),
        }

    def close(self) -> None:
        """Give back its memory."""
        self._engine.disconnect()

    def _shape(self, link: _Link) -> int:
        """Make what of a link touches the ground; -1 for none."""
        engine, model = self._engine, self.robot.model
        shapes = [_geom(engine, model, geom, link.anchor) for geom in _touching(model, link.body)]
        if not shapes:
            return -1
        lists = {name: [shape[name] for shape in shapes] for name in shapes[0]}
        found: int = engine.createCollisionShapeArray(**lists)
        return found


def _moving(model: mujoco.MjModel) -> list[int]:
    """The joints but for the base's, in the order of their coordinates."""
    return [j for j in range(model.njnt) if model.jnt_type[j] != mujoco.mjtJoint.mjJNT_FREE]


def _links(robot: Robot) -> Iterator[_Link]:
    """A robot's links, parents first: a body with several joints is a chain of them."""
    model, index = robot.model, {robot.base_body: -1}
    anchors, count = {robot.base_body: np.zeros(3)}, 0
    for body in range(robot.base_body + 1, model.nbody):
        parent = int(model.body_parentid[body])
        if parent not in index:
            continue
        before, place = index[parent], model.body_pos[body] - anchors[parent]
        quaternion, at = model.body_quat[body], np.zeros(3)
        first = model.body_jntadr[body]
        joints = [*range(first, first + model.body_jntnum[body])] or [-1]
        for joint in joints:
            anchor = model.jnt_pos[joint] if joint >= 0 else np.zeros(3)
            moved = _matrix(quaternion) @ (anchor - at)
            own = body if joint == joints[-1] else -1
            yield _Link(before, place + moved, quaternion, joint, own, anchor)
            before, count = count, count + 1
            place, quaternion, at = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), anchor
        index[body], anchors[body] = before, at


def _inertia(
    model: mujoco.MjModel, link: _Link, armature: bool
) -> tuple[float, np.ndarray, np.ndarray, np.ndarray]:
    """Mass, centre (3,), principal axes as a quaternion (4,), and moments about them (3,)."""
    mass, centre, tensor = 0.0, np.zeros(3), np.zeros((3, 3))
    if link.body >= 0:
        axes = _matrix(model.body_iquat[link.body])
        mass, centre = float(model.body_mass[link.body]), model.body_ipos[link.body] - link.anchor
        tensor = axes @ np.diag(model.body_inertia[link.body]) @ axes.T
    if armature and link.joint >= 0 and model.jnt_type[link.joint] == mujoco.mjtJoint.mjJNT_HINGE:
        axis = model.jnt_axis[link.joint]
        tensor = tensor + model.dof_armature[model.jnt_dofadr[link.joint]] * np.outer(axis, axis)
    moments, axes = np.linalg.eigh(tensor)
    axes[:, 2] *= np.linalg.det(axes)
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(axes).ravel())
    return mass, centre, quaternion, np.maximum(moments, 0.0)


def _kind(engine: Any, model: mujoco.MjModel, joint: int) -> int:
    kinds = {
        int(mujoco.mjtJoint.mjJNT_HINGE): engine.JOINT_REVOLUTE,
        int(mujoco.mjtJoint.mjJNT_SLIDE): engine.JOINT_PRISMATIC,
    }
    kind = int(model.jnt_type[joint])
    if kind not in kinds or model.neq:
        raise RobotError("For Bullet, joints have to be hinges or slides, without equalities.")
    found: int = kinds[kind]
    return found


def _touching(model: mujoco.MjModel, body: int) -> list[int]:
    """Geoms of a body that touch the ground."""
    solid = model.geom_contype | model.geom_conaffinity
    return [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == body and solid[geom]]


def _geom(engine: Any, model: mujoco.MjModel, geom: int, anchor: np.ndarray) -> dict[str, Any]:
    kind, size = _SHAPES.get(int(model.geom_type[geom])), model.geom_size[geom]
    if kind is None:
        expected = ", ".join(_SHAPES.values())
        raise RobotError(f"Geom {model.geom(geom).name!r} has no shape for Bullet: {expected}.")
    return {
        "shapeTypes": getattr(engine, f"GEOM_{kind.upper()}"),
        "radii": float(size[0]),
        "halfExtents": size.tolist(),
        "lengths": 2.0 * float(size[1]),
        "collisionFramePositions": (model.geom_pos[geom] - anchor).tolist(),
        "collisionFrameOrientations": _xyzw(model.geom_quat[geom]),
    }


def _matrix(quaternion: np.ndarray) -> np.ndarray:
    """(3, 3) of a quaternion wxyz."""
    found = np.zeros(9)
    mujoco.mju_quat2Mat(found, np.ascontiguousarray(quaternion, float))
    return found.reshape(3, 3)


def _xyzw(quaternion: np.ndarray) -> list[float]:
    found: list[float] = np.asarray(quaternion)[[1, 2, 3, 0]].tolist()
    return found
