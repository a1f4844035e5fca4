"""A floating-base robot: compiled model, feet with their contact points, limits, home pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from fbid_gym.errors import RobotError
from fbid_gym.robots import mjcf
from fbid_gym.robots.feet import Foot, find_foot, group_points
from fbid_gym.robots.home import home_configuration
from fbid_gym.robots.motors import motor_of_each_joint
from fbid_gym.robots.scene import add_contact_sensors, add_ground

_OBJ = mujoco.mjtObj


@dataclass(frozen=True, eq=False)
class Robot:
    """One floating-base robot with a torque motor on every joint. Immutable; share it freely.

    Arrays over joints are in MuJoCo's dof order without the base. Generalized velocity is
    v = [base linear velocity (world), base angular velocity (base frame), joint velocities].

    Attributes:
        name: the robot's name.
        model: compiled model, with a ground and one contact-force sensor per contact point. Copy
            it before changing it.
        spec: what `model` was compiled from. Add bodies to a copy of it, and the robot keeps its
            place at the head of every list.
        feet: the feet, in the order given.
        base_body: MuJoCo id of the floating body.
        home_qpos: (nq,) a standing pose, the lowest contact point at z = 0.
        joint_names: n names.
        torque_limit: (n,) N·m (N for slides), the same in both directions.
        joint_range: (n, 2) rad (m for slides), +-inf where unlimited.
        actuator: (n,) id of the actuator that drives each joint.
        gear: (n,) torque per unit of ctrl: ctrl[actuator] = torque / gear.
        contact_sensor: (P, 3) columns of `sensordata` that hold the world-frame force on the robot
            at each contact point, N. Points in the order of the feet.
        mass: kg.
    """

    name: str
    model: mujoco.MjModel
    spec: mujoco.MjSpec
    feet: tuple[Foot, ...]
    base_body: int
    home_qpos: np.ndarray
    joint_names: tuple[str, ...]
    torque_limit: np.ndarray
    joint_range: np.ndarray
    actuator: np.ndarray
    gear: np.ndarray
    contact_sensor: np.ndarray
    mass: float

    def __post_init__(self) -> None:
        """Protect the arrays: built-in robots are shared."""
        for value in (*vars(self).values(), *(foot.points for foot in self.feet)):
            if isinstance(value, np.ndarray):
                value.setflags(write=False)

    @property
    def nq(self) -> int:
        """Size of qpos: 7 + n."""
        return int(self.model.nq)

    @property
    def nv(self) -> int:
        """Size of the generalized velocity: 6 + n."""
        return int(self.model.nv)

    @property
    def num_joints(self) -> int:
        """Number n of actuated joints."""
        return len(self.joint_names)

    @property
    def num_feet(self) -> int:
        """Number of feet."""
        return len(self.feet)

    @property
    def num_points(self) -> int:
        """Number P of contact points of all feet."""
        return sum(foot.num_points for foot in self.feet)

    @property
    def foot_names(self) -> tuple[str, ...]:
        """Names of the feet."""
        return tuple(foot.name for foot in self.feet)

    @property
    def weight(self) -> float:
        """Weight in N."""
        return self.mass * self.gravity

    @property
    def gravity(self) -> float:
        """Size of the gravity that its model lives in, m/s²."""
        return float(np.linalg.norm(self.model.opt.gravity))

    @property
    def joint_damping(self) -> np.ndarray:
        """(n,) viscous damping of the joints, N·m·s/rad. Not part of the bias force h."""
        return np.array(self.model.dof_damping[6:])

    @classmethod
    def from_mjcf(
        cls,
        path: str | Path,
        feet: Mapping[str, Sequence[str]] | Sequence[str],
        *,
        name: str | None = None,
        home: Mapping[str, float] | Sequence[float] | np.ndarray | str | None = None,
        base: str | None = None,
    ) -> "Robot":
        """Load a robot from an MJCF file.

        A ground plane, light and sky are added if the file has nothing to stand on. The integrator
        becomes `implicitfast` and the constraint Jacobian dense; everything else in the file stays.

        Args:
            path: an MJCF with one floating base: one free joint on a top-level body, hinges and
                slides below it, one torque motor with a finite limit on each.
            feet: foot name -> names of its contact points; or a sequence of names, each a foot with
                one point. A point is a site, a sphere, or a capsule (its end farther from the
                body's origin). The points of one foot lie on one body; its spheres are equal.
            name: the robot's name; the model's name by default.
            home: joint name -> rad (m for slides), the rest from the default; or a whole qpos
                (nq,); or the name of a keyframe. Default: the keyframe "home" if there is one, else
                the model's reference pose moved into the joint ranges. The base height is always
                set so that the lowest contact point touches z = 0.
            base: a top-level body that shall float, if the file has no free joint.

        Raises:
            RobotError: the file or the robot in it cannot be used.
            FbidError: an argument cannot be used. Both name the value and the valid choices.
        """
        groups = group_points(feet)
        spec = mjcf.read_spec(path)
        plain = mjcf.compile_spec(spec, path)
        if base is not None and not mjcf.free_joints(plain):
            mjcf.float_base(spec, base)
            plain = mjcf.compile_spec(spec, path)
        base_body = mjcf.check_tree(plain)
        base_name = mjcf.object_name(plain, _OBJ.mjOBJ_BODY, base_body)
        if base is not None and base != base_name:
            raise RobotError(f"The free joint is on body {base_name!r}, not on base={base!r}.")
        actuator, gear, torque_limit = motor_of_each_joint(plain)
        points = [find_foot(plain, foot, names) for foot, names in groups.items()]

        # Bodies, joints and actuators keep their ids: only geoms, sites, lights and sensors join.
        add_ground(spec, plain, base_body)
        sensors = add_contact_sensors(spec, points)
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model = mjcf.compile_spec(spec, path)

        built = tuple(
            Foot(
                name=foot,
                body=found[0].body,
                point_names=tuple(point.name for point in found),
                points=np.array([point.position for point in found]),
                radius=found[0].radius,
            )
            for foot, found in zip(groups, points, strict=True)
        )
        joints = mjcf.moving_joints(model)
        limited = model.jnt_limited[joints].astype(bool)[:, None]
        columns = [model.sensor_adr[model.sensor(s).id] + np.arange(3) for s in sensors]
        return cls(
            name=name or spec.modelname or Path(path).stem,
            model=model,
            spec=spec,
            feet=built,
            base_body=base_body,
            home_qpos=home_configuration(model, home, built),
            joint_names=tuple(mjcf.object_name(model, _OBJ.mjOBJ_JOINT, j) for j in joints),
            torque_limit=torque_limit,
            joint_range=np.where(limited, model.jnt_range[joints], [-np.inf, np.inf]),
            actuator=actuator,
            gear=gear,
            contact_sensor=np.array(columns, dtype=int),
            mass=float(model.body_subtreemass[base_body]),
        )
