"""A floating-base robot: compiled model, feet with their contact points, limits, home pose."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import mujoco
import numpy as np

from fbid_gym.bundles import write_file
from fbid_gym.errors import InvalidValueError, RobotError
from fbid_gym.robots import archive, home_check, mjcf, motors
from fbid_gym.robots.by_joint import ByJoint, by_joint
from fbid_gym.robots.contact_sensors import add_contact_sensors, sensor_columns
from fbid_gym.robots.description import described
from fbid_gym.robots.feet import Foot, contacts, find_feet, group_points
from fbid_gym.robots.home import home_pose, on_the_ground, stands_up, unspecified
from fbid_gym.robots.measured_model import LEGS, MeasuredModel
from fbid_gym.robots.normalise import exclude_overlaps, normalise, simulate_well
from fbid_gym.robots.scene import add_ground
from fbid_gym.robots.source import RobotSource, Source
from fbid_gym.robots.stand import check_clear, stand_up, stands
from fbid_gym.robots.touching import refuse_wheels
from fbid_gym.robots.unmodelled import refuse_diverging, refuse_unmodelled

if TYPE_CHECKING:
    from fbid_gym.robots.drives import Drives

_LOG = logging.getLogger("fbid_gym")

_UNNAMED = mujoco.MjSpec().modelname
_OBJ = mujoco.mjtObj


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """One floating-base robot with a torque motor on every joint. Immutable; share it freely.

    Arrays over joints are in MuJoCo's dof order without the base. Generalized velocity is
    v = [base linear velocity (world), base angular velocity (base frame), joint velocities].
    """

    name: str
    model: mujoco.MjModel
    """Compiled, with a ground and one contact-force sensor per contact point; copy it to change."""
    spec: mujoco.MjSpec
    """What `model` is of. Add bodies to a copy, and the robot stays at the head of every list."""
    feet: tuple[Foot, ...]
    """In the order given."""
    base_body: int
    """MuJoCo id of the floating body."""
    home_qpos: np.ndarray
    """(nq,) standing above the origin, facing along x, the lowest contact point at z = 0."""
    joint_names: tuple[str, ...]
    torque_limit: np.ndarray
    """(n,) N·m (N for slides), the same in both directions."""
    joint_range: np.ndarray
    """(n, 2) rad (m for slides), +-inf where unlimited."""
    actuator: np.ndarray
    """(n,) id of the actuator that drives each joint."""
    gear: np.ndarray
    """(n,) torque per unit of ctrl: ctrl[actuator] = torque / gear."""
    contact_sensor: np.ndarray
    """(P, 3) columns of `sensordata`: N, world, on the robot at each point in the order of feet."""
    mass: float  # kg
    notes: tuple[str, ...] = ()
    """What was changed of the file, one sentence each."""
    servo_gains: motors.ServoGains | None = None
    """Of the file's servos, which are torque motors now; None if it had none."""
    drives: "Drives | None" = None
    """What motors can give beyond `torque_limit`, see `fbid_gym.robots.drives`; None: ideal."""

    _made: ClassVar[tuple[Callable[..., "Robot"], tuple[Any, ...]] | None] = None

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
    def has_soles(self) -> bool:
        """Whether a foot has more than a point to stand on."""
        return self.num_points > self.num_feet

    @property
    def foot_names(self) -> tuple[str, ...]:
        """Names of the feet."""
        return tuple(foot.name for foot in self.feet)

    @cached_property
    def at_home(self) -> MeasuredModel:
        """Its model in the home pose, measured."""
        return MeasuredModel(self.model, self.home_qpos)

    @cached_property
    def points_at_home(self) -> np.ndarray:
        """(P, 3) m, world: where its contact points touch at home, the lowest at z = 0."""
        return contacts(self.feet, self.at_home.data)

    @property
    def weight(self) -> float:
        """Weight in N."""
        return self.mass * self.gravity

    @property
    def gravity(self) -> float:
        """Size of the gravity that its model lives in, m/s²."""
        return self.at_home.gravity

    @property
    def joint_damping(self) -> np.ndarray:
        """(n,) viscous damping of the joints, N·m·s/rad. Not part of the bias force h."""
        return np.array(self.model.dof_damping[6:])

    def check(self) -> list[str]:
        """Say what speaks against the home pose and the model; one sentence each, with the number.

        See `fbid_gym.robots.home_check`.
        """
        return home_check.findings(self)

    @property
    def as_loaded(self) -> "Robot":
        """The robot that was loaded, of which this one was made: with motors, its feet in order."""
        first = self._made[1][0] if self._made else None
        return first.as_loaded if isinstance(first, Robot) else self

    def __repr__(self) -> str:
        """Say what it is, and what was changed of its file."""
        size = f"{self.num_joints} joints, {self.num_feet} feet on {self.num_points} points"
        return "\n- ".join([f"<Robot {self.name!r}: {size}, {self.mass:.3g} kg>", *self.notes])

    def __copy__(self) -> "Robot":
        """Return itself: nothing in it changes."""
        return self

    def __deepcopy__(self, memo: dict[int, object]) -> "Robot":
        """Return itself: nothing in it changes."""
        return self

    def __reduce__(self) -> tuple[Callable[..., "Robot"], tuple[Any, ...]]:
        """Pickle how it was made; unpickling makes it again. One that was changed cannot be."""
        if self._made is None:
            raise RobotError(
                f"Robot {self.name!r} was changed after it was loaded, so it cannot be pickled. "
                "Load the changed MJCF instead."
            )
        return self._made

    def save(self, path: str | Path) -> None:
        """Write one file that `load` reads, with all the robot needs: its name ends in ".zip".

        MuJoCo rounds the numbers of an MJCF to six digits when it writes them; see `portable`.

        Raises:
            RobotError: it was changed after it was loaded.
            InvalidValueError: another kind of file name.
        """
        path = Path(path)
        if path.suffix != archive.SUFFIX:
            raise InvalidValueError("path", str(path), f"a name that ends in {archive.SUFFIX!r}")
        write_file(path, self._archive())

    def portable(self) -> "Robot":
        """Return this robot as `load` reads it from what `save` writes: equal to the last bit."""
        packed, options = archive.split(self._archive(), self.name)
        return Robot.from_mjcf(Source.known(packed), **options)

    @property
    def digest(self) -> str:
        """SHA-256 of what `save` writes: equal for the same robot alone, as it was loaded."""
        return archive.digest(self._archive())

    def _archive(self) -> bytes:
        source, given = self.as_loaded.__reduce__()[1]
        packed = source.content
        if not isinstance(packed, bytes):
            packed = archive.pack(normalise(source, given["base"]).spec)
        return archive.with_arguments(packed, {**given, "name": self.name})

    def made_by(self, function: Callable[..., "Robot"], *arguments: Any) -> "Robot":
        """Remember how this robot was made, for pickling; returns it."""
        object.__setattr__(self, "_made", (function, arguments))
        return self

    @classmethod
    def load(
        cls,
        source: RobotSource,
        feet: Mapping[str, Sequence[str]] | Sequence[str] | None = None,
        **options: Any,
    ) -> "Robot":
        """Load a robot with what the `robot.toml` beside its file says of it.

        Args:
            source: as for `from_mjcf`; or the path of what `save` wrote; or of a `robot.toml`,
                whose key `mjcf` names the file, and whose others are arguments of `from_mjcf`.
            feet: as for `from_mjcf`, and
            options: its others; they go before those of the file.

        Raises:
            FbidError: as `from_mjcf`, or a `robot.toml` that cannot be used.
        """
        source, written = described(source)
        given = options if feet is None else {"feet": feet, **options}
        return cls.from_mjcf(source, **(written | given))

    @classmethod
    def from_mjcf(
        cls,
        source: RobotSource,
        feet: Mapping[str, Sequence[str]] | Sequence[str] | None = None,
        *,
        name: str | None = None,
        home: Mapping[str, float] | Sequence[float] | np.ndarray | str | None = None,
        base: str | None = None,
        torque_limit: ByJoint | None = None,
        armature: ByJoint | None = None,
    ) -> "Robot":
        """Load a robot from an MJCF or a URDF.

        What does not fit is set right where that is plain, and noted in `notes`: position and
        velocity servos become torque motors with the same force limits, motors are added where a
        joint has none and its limit is known, the free joint loses armature and friction, one
        solver iteration becomes enough. A ground plane, light and sky are added if the file has
        nothing to stand on. The integrator becomes `implicitfast` and the constraint Jacobian
        dense; everything else in the file stays. What `check` finds is logged as warnings.

        Args:
            source: path or text of an MJCF or URDF, an `mujoco.MjSpec`, a name of
                `robot_descriptions`, or "menagerie:NAME" for one of `mujoco_menagerie`
                ("menagerie:NAME/FILE" for another of its files than the usual one). It holds one
                robot of hinges and slides: in an MJCF with one free joint on a top-level body; a
                URDF's root link is made to float.
            feet: foot name -> names of its contact points, or of its body; or a sequence of names,
                each of a foot with one point, or of its body. A point is a site, a sphere, or a
                capsule (its end farther from the body's origin). The points of one foot lie on one
                body; its spheres are equal. Of a body, the points are those where its geometry
                touches level ground at home. Default: the lowest bodies at the ends of the limbs.
            name: the robot's name; the model's name by default.
            home: joint name -> rad (m for slides), the rest from the keyframe "home", or else the
                model's reference pose moved into the joint ranges; or a whole qpos (nq,); or the
                name of a keyframe; or "stand", a standing pose that is searched for where the file
                has no keyframe of that name. Default: "stand", if there is such a pose, of a URDF,
                and of an MJCF without a keyframe "home" whose reference pose is no stance: a leg is
                straight, or the centre of mass is not above the feet; else {}. The base is always
                put above the origin, with its x axis along the world's as seen from above, and so
                high that the lowest contact point touches z = 0.
            base: a top-level body that shall float, if the file has no free joint.
            torque_limit: N·m (N for slides), one for all joints or by name or pattern ("*_knee");
                in place of the file's limits, and for joints without motor.
            armature: kg·m² (kg for slides) likewise.

        Raises:
            RobotError: the file or the robot in it cannot be used.
            FbidError: an argument cannot be used. Both name the value and the valid choices.
        """
        given = {
            **{"feet": feet, "name": name, "home": home},
            **{"base": base, "torque_limit": torque_limit, "armature": armature},
        }
        robot = _build(Source.of(source), given)
        for sentence in robot.check():
            _LOG.warning("%s: %s", robot.name, sentence)
        return robot


def _build(source: Source, given: dict[str, Any]) -> Robot:
    """Load a robot by arguments of `Robot.from_mjcf`; unpickling does this once more."""
    feet, name, home, base = (given[key] for key in ("feet", "name", "home", "base"))
    if not isinstance(name, str | None):
        raise InvalidValueError("name", name, "text")
    named = None if feet is None else group_points(feet)
    spec, plain, notes, bare = normalise(source, base)
    base_body = refuse_unmodelled(plain)
    floating = mjcf.object_name(plain, _OBJ.mjOBJ_BODY, base_body)
    if base not in (None, floating):
        raise RobotError(f"The free joint is on body {floating!r}, not on base={base!r}.")
    # Bodies, joints and actuators keep their ids, but are not told them once something is added.
    bodies = {body.id: body for body in spec.bodies}
    joint_names = mjcf.name_joints(spec, plain)
    gains = motors.servo_gains(plain)
    notes += simulate_well(spec)
    notes += motors.set_armature(spec, by_joint("armature", given["armature"], joint_names))
    limits = by_joint("torque_limit", given["torque_limit"], joint_names)
    notes += motors.use_motors(spec, plain, limits)

    start = MeasuredModel(plain, home_pose(plain, joint_names, home))
    qpos, found = start.qpos, find_feet(start, named)
    _refuse_bare(start, found, bare)
    refuse_wheels(start, [foot.body for foot in found])
    if named is None:
        notes += [f"Feet found: {', '.join(foot.name for foot in found)}."]
    asked = stands_up(plain, home)
    # In the reference pose of a URDF all joints are at 0, that of an MJCF may be drawn as a stance.
    if asked or (unspecified(plain, home) and (source.is_urdf or not stands(start, found))):
        try:
            standing, pose = stand_up(start, found, named)
            if not asked:
                check_clear(MeasuredModel(plain, pose), standing)
                notes += ["Home is a standing pose that was searched for."]
            found, qpos = standing, pose
        except RobotError as reason:
            if asked:
                raise
            notes += [f"Home is the reference pose. {reason}"]
    at_home = MeasuredModel(plain, on_the_ground(plain, qpos, found))

    notes += exclude_overlaps(spec, at_home, bodies)
    add_ground(spec, at_home, bodies[base_body], found)
    sensors = add_contact_sensors(spec, at_home, bodies, found)
    model = mjcf.compile_spec(spec, source.label)
    actuator, gear, limit = motors.motor_of_each_joint(model)
    refuse_diverging(MeasuredModel(model, at_home.qpos), source.label)
    own_name = "" if spec.modelname == _UNNAMED else str(spec.modelname)
    robot = Robot(
        name=name or own_name or source.name,
        model=model,
        spec=spec,
        feet=found,
        base_body=base_body,
        home_qpos=at_home.qpos,
        joint_names=joint_names,
        torque_limit=limit,
        joint_range=mjcf.joint_range(model),
        actuator=actuator,
        gear=gear,
        contact_sensor=sensor_columns(model, sensors),
        mass=float(model.body_subtreemass[base_body]),
        notes=tuple(notes),
        servo_gains=gains,
    )
    return robot.made_by(_build, source, given)


def _refuse_bare(start: MeasuredModel, feet: tuple[Foot, ...], bare: list[str]) -> None:
    """Refuse a robot that lost a mesh by which one of its feet would touch the ground."""
    weld, ids = start.model.body_weldid, {name: start.model.body(name).id for name in bare}
    legs = {weld[foot.body] for foot in feet}
    low = contacts(feet, start.data)[:, 2].max() + LEGS * start.com[2]
    lost = [n for n, b in ids.items() if weld[b] in legs or start.data.xpos[b, 2] <= low]
    if lost:
        raise RobotError(
            f"Meshes of the bodies {mjcf.listed(lost)}, which they may stand on, are not found, or "
            "of no kind that can be read (install trimesh and pycollada for .dae). Expected them "
            "beside the file, or feet with other geometry."
        )
