"""A floating-base robot: compiled model, feet with their contact points, limits, home pose."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.robots import mjcf
from fbid_gym.robots.home import home_configuration

MAX_POINTS_PER_FOOT = 8
"""More add no force a rigid foot can use (four corners span its 6 dimensions) but cost time."""


@dataclass(frozen=True, eq=False)
class Foot:
    """A rigid body with named contact points.

    Attributes:
        name: the foot's name.
        body: MuJoCo id of the body that carries the points.
        point_names: P names of sites or geoms.
        points: (P, 3) m, body frame: positions of sites, centres of spheres.
        radius: m. 0 for sites; for spheres their radius: the contact lies `radius` below (world -z)
            the point.
    """

    name: str
    body: int
    point_names: tuple[str, ...]
    points: np.ndarray
    radius: float

    @property
    def num_points(self) -> int:
        """Number of contact points."""
        return len(self.point_names)


@dataclass(frozen=True, eq=False)
class Robot:
    """One floating-base robot with a torque motor on every joint. Immutable; share it freely.

    Arrays over joints are in MuJoCo's dof order without the base. Generalized velocity is
    v = [base linear velocity (world), base angular velocity (base frame), joint velocities].

    Attributes:
        name: the robot's name.
        model: compiled model, with a ground and one contact-force sensor per contact point. Copy it
            before changing it.
        feet: the feet, in the order given.
        base_body: MuJoCo id of the floating body.
        home_qpos: (nq,) a standing pose, the lowest contact point at z = 0.
        joint_names: n names.
        torque_limit: (n,) N m (N for slides), the same in both directions.
        joint_range: (n, 2) rad (m for slides), +-inf where unlimited.
        actuator: (n,) id of the actuator that drives each joint.
        gear: (n,) torque per unit of ctrl: ctrl[actuator] = torque / gear.
        contact_sensor: (P, 3) columns of `sensordata` that hold the world-frame force on the robot at
            each contact point, N. Points in the order of the feet.
        mass: kg.
    """

    name: str
    model: mujoco.MjModel
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
        return self.mass * float(np.linalg.norm(self.model.opt.gravity))

    @property
    def joint_damping(self) -> np.ndarray:
        """(n,) viscous damping of the joints, N m s/rad. Not part of the bias force h."""
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
            path: an MJCF with one floating base: one free joint on a top-level body, hinges and slides
                below it, one torque motor with a finite limit on each.
            feet: foot name -> names of its contact points; or a sequence of names, each a foot with
                one point. A point is a site, a sphere, or a capsule (its end farther from the body's
                origin). The points of one foot lie on one body; spheres of one foot are equal.
            name: the robot's name; the model's name by default.
            home: joint name -> rad (m for slides), the rest from the default; or a whole qpos (nq,); or
                the name of a keyframe. Default: the keyframe "home" if there is one, else the model's
                reference pose moved into the joint ranges. The base height is always set so that the
                lowest contact point touches z = 0.
            base: a top-level body that shall float, if the file has no free joint.

        Raises:
            RobotError: the file or the robot in it cannot be used.
            FbidError: an argument cannot be used. Both name the value and the valid choices.
        """
        groups = _grouped(feet)
        spec = mjcf.read_spec(path)
        plain = mjcf.compile_spec(spec, path)
        if base is not None and not mjcf.free_joints(plain):
            mjcf.float_base(spec, base)
            plain = mjcf.compile_spec(spec, path)
        base_body = mjcf.check_tree(plain)
        base_name = mjcf.object_name(plain, mujoco.mjtObj.mjOBJ_BODY, base_body)
        if base is not None and base != base_name:
            raise RobotError(f"The free joint is on body {base_name!r}, not on base={base!r}.")
        points = [_points_of(plain, foot, names) for foot, names in groups.items()]

        mjcf.add_ground(spec, plain, base_body)
        sensors = mjcf.add_contact_sensors(spec, points)
        spec.option.jacobian = mujoco.mjtJacobian.mjJAC_DENSE
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        model = mjcf.compile_spec(spec, path)

        actuator, gear, torque_limit = mjcf.motor_of_each_joint(model)
        built = tuple(
            Foot(
                name=foot,
                body=found[0].body,
                point_names=tuple(p.name for p in found),
                points=np.array([p.position for p in found]),
                radius=found[0].radius,
            )
            for foot, found in zip(groups, points, strict=True)
        )
        joints = np.flatnonzero(model.jnt_type != mujoco.mjtJoint.mjJNT_FREE)
        limited = model.jnt_limited[joints].astype(bool)[:, None]
        columns = [model.sensor_adr[model.sensor(s).id] + np.arange(3) for s in sensors]
        return cls(
            name=name or model.names.split(b"\0", 1)[0].decode() or Path(path).stem,
            model=model,
            feet=built,
            base_body=base_body,
            home_qpos=home_configuration(model, home, built),
            joint_names=tuple(
                mjcf.object_name(model, mujoco.mjtObj.mjOBJ_JOINT, int(j)) for j in joints
            ),
            torque_limit=torque_limit,
            joint_range=np.where(limited, model.jnt_range[joints], [-np.inf, np.inf]),
            actuator=actuator,
            gear=gear,
            contact_sensor=np.array(columns, dtype=int),
            mass=float(model.body_subtreemass[base_body]),
        )


def _grouped(feet: Mapping[str, Sequence[str]] | Sequence[str]) -> dict[str, tuple[str, ...]]:
    """Feet as foot name -> point names, checked for form and for names given twice."""
    expected = "foot name -> names of its sites or sphere geoms, or a list of such names"
    if isinstance(feet, str) or not isinstance(feet, Mapping | Sequence):
        raise InvalidValueError("feet", feet, expected)
    if isinstance(feet, Mapping):
        groups = {foot: (p,) if isinstance(p, str) else tuple(p) for foot, p in feet.items()}
    else:
        if len(set(feet)) < len(feet):
            raise RobotError(f"Foot {_first_repeated(feet)!r} is given twice. Expected distinct feet.")
        groups = {foot: (foot,) for foot in feet}
    if not groups:
        raise InvalidValueError("feet", feet, f"at least one foot: {expected}")
    for foot, names in groups.items():
        if not 1 <= len(names) <= MAX_POINTS_PER_FOOT:
            raise RobotError(
                f"Foot {foot!r} has {len(names)} contact points. "
                f"Expected 1 to {MAX_POINTS_PER_FOOT}."
            )
    every = [name for names in groups.values() for name in names]
    if len(set(every)) < len(every):
        raise RobotError(
            f"Contact point {_first_repeated(every)!r} is given twice. Expected distinct points."
        )
    return groups


def _first_repeated(names: Sequence[str]) -> str:
    return next(name for i, name in enumerate(names) if name in names[:i])


def _points_of(
    model: mujoco.MjModel, foot: str, names: tuple[str, ...]
) -> list[mjcf.ContactPoint]:
    """The contact points of one foot, checked to be rigid to each other and alike."""
    points = [mjcf.find_point(model, name) for name in names]
    bodies = {
        p.name: mjcf.object_name(model, mujoco.mjtObj.mjOBJ_BODY, p.body) for p in points
    }
    if len(set(bodies.values())) > 1:
        where = ", ".join(f"{point} on {body}" for point, body in bodies.items())
        raise RobotError(f"Foot {foot!r} has points on different bodies: {where}. Expected one body.")
    if len({p.kind for p in points}) > 1:
        raise RobotError(f"Foot {foot!r} mixes sites and geoms: {', '.join(names)}. Expected one kind.")
    if len({p.radius for p in points}) > 1:
        radii = ", ".join(f"{p.name} {p.radius:g} m" for p in points)
        raise RobotError(f"Foot {foot!r} has spheres of different radii: {radii}. Expected one radius.")
    return points
