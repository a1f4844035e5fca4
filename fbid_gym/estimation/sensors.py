"""The sensors of a robot as data: what they err by, how often they measure, how late they tell.

An inertial unit sits in the trunk, an encoder on each joint, and a sensor in each foot, unless
contacts are told from the motors' torques. A reading of the unit is

    (1 + scale) turned by the misalignment, of the true one, + bias + noise, within its range,

with a bias that wanders. Noise is white: its density times the square root of the sensor's rate is
the standard deviation of a reading, as for Kalibr's model of an inertial unit; a data sheet's
density of one side of the spectrum is so taken to be sqrt(2) times as much, the careful way. What
is constant is drawn for each robot and episode from a normal distribution about 0, whose standard
deviation is the number here. A data sheet's typical offsets are taken to be that.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import exp, pi, radians, sqrt
from typing import Annotated, Any

from fbid_gym.checks import by_name, check_choices
from fbid_gym.errors import InvalidValueError, UnknownOptionError
from fbid_gym.options import Choice, Number, Pair, Whole, check_fields, options_of

_G = 9.80665

LONGEST_LATENCY = 0.05
"""s; every reading on its way is remembered."""

CONTACTS = ("force", "torque")

ESTIMATORS = ("invariant", "linear")

Rate = Annotated[int, Whole(1, 100_000, "Hz")]
Latency = Annotated[tuple[float, float], Pair(0.0, 1.0, "s")]


@dataclass(frozen=True)
class Sensors:
    """Sensors of one kind of robot. All zeros are sensors that do not err."""

    gyroscope_noise: Annotated[float, Number(0.0, 1.0, "rad/s/sqrt(Hz)")] = 0.0
    """Density of its noise, rad/s/sqrt(Hz)."""
    gyroscope_bias: Annotated[float, Number(0.0, 1.0, "rad/s")] = 0.0
    """rad/s at the start, each axis."""
    gyroscope_drift: Annotated[float, Number(0.0, 1.0, "rad/s/sqrt(s)")] = 0.0
    """rad/s by which that bias wanders in a second; the square root of the time counts."""
    gyroscope_scale: Annotated[float, Number(0.0, 0.2)] = 0.0
    """Share by which each axis reads too much."""
    gyroscope_range: Annotated[float, Number(1.0, 1000.0, "rad/s")] = 1000.0
    """rad/s, the most it reads."""
    accelerometer_noise: Annotated[float, Number(0.0, 10.0, "m/s^2/sqrt(Hz)")] = 0.0
    """Density of its noise, m/s^2/sqrt(Hz)."""
    accelerometer_bias: Annotated[float, Number(0.0, 5.0, "m/s^2")] = 0.0
    """m/s^2 at the start, each axis."""
    accelerometer_drift: Annotated[float, Number(0.0, 1.0, "m/s^2/sqrt(s)")] = 0.0
    """m/s^2 by which that bias wanders in a second."""
    accelerometer_scale: Annotated[float, Number(0.0, 0.2)] = 0.0
    """Share by which each axis reads too much."""
    accelerometer_range: Annotated[float, Number(20.0, 1e5, "m/s^2")] = 1e5
    """m/s^2, the most it reads. It reads the mean since the last reading, as a filter against
    aliasing makes it."""
    misalignment: Annotated[float, Number(0.0, 0.5, "rad")] = 0.0
    """rad by which the unit is turned about each axis against where it should sit."""
    imu_rate: Rate | None = None
    """Readings per second; divides `control_hz`. Default: that."""
    imu_latency: Latency = (0.0, 0.0)
    """(least, most) s from a reading to its use, in whole control ticks."""
    encoder_resolution: Annotated[float, Number(0.0, 0.1, "rad")] = 0.0
    """rad (m for slides), step of a joint's position."""
    encoder_noise: Annotated[float, Number(0.0, 0.1, "rad")] = 0.0
    """rad (m for slides), of each position before it is rounded to that step."""
    encoder_filter: Annotated[float, Number(1.0, 1e5, "Hz")] | None = None
    """Hz, corner of the low pass of first order that joint velocities go through: they are
    differences of positions. Default: none."""
    encoder_rate: Rate | None = None
    """Readings per second; divides `control_hz`. Default: that."""
    encoder_latency: Latency = (0.0, 0.0)
    """(least, most) s from a reading to its use."""
    contact: Annotated[str, Choice(CONTACTS)] = "force"
    """How contacts are told: "force" by a sensor in each foot, or "torque", from the motors'
    torques and the model."""
    contact_noise: Annotated[float, Number(0.0, 1.0)] = 0.0
    """Share of the robot's weight: noise of the force on a foot."""
    contact_threshold: Annotated[float, Number(0.001, 1.0)] = 0.02
    """Share of the robot's weight above which a foot counts as on the ground."""
    contact_errors: Annotated[float, Number(0.0, 0.5)] = 0.0
    """Share of the time for which a foot's sensor tells the wrong thing, 20 ms at a time."""
    contact_rate: Rate | None = None
    """Readings per second; divides `control_hz`. Default: that."""
    contact_latency: Latency = (0.0, 0.0)
    """(least, most) s from a reading to its use."""
    estimator: Annotated[str, Choice(ESTIMATORS)] = "invariant"
    """What makes an estimate of the readings: "invariant", an extended Kalman filter, or "linear",
    a simpler one, see `fbid_gym.estimation.linear_filter`."""
    scale: Annotated[float, Number(0.0, 100.0)] = 1.0
    """Factor on all noise, biases, drifts, errors of scale and mounting, steps of encoders."""

    def __post_init__(self) -> None:
        """Check each value."""
        check_fields(self, "sensors {}")
        expected = f"at most {LONGEST_LATENCY:g} s: no older reading is remembered"
        for name in ("imu_latency", "encoder_latency", "contact_latency"):
            if getattr(self, name)[1] > LONGEST_LATENCY:
                raise InvalidValueError(f"sensors {name}", getattr(self, name), expected)

    def every(self, name: str, control_hz: int) -> int:
        """Return control ticks from one reading to the next, of "imu", "encoder" or "contact".

        Raises:
            InvalidValueError: a rate that does not divide that of the control.
        """
        rate = getattr(self, f"{name}_rate") or control_hz
        if control_hz % rate:
            expected = f"a divisor of control_hz = {control_hz}"
            raise InvalidValueError(f"sensors {name}_rate", rate, expected)
        return int(control_hz // rate)

    def follow(self, control_hz: int) -> float:
        """Return the share of the way to the newest velocity that the low pass goes at a reading.

        Raises:
            InvalidValueError: as `every`.
        """
        rate = control_hz / self.every("encoder", control_hz)
        corner = self.encoder_filter
        return 1.0 if corner is None else 1.0 - exp(-2.0 * pi * corner / rate)

    @property
    def scaled(self) -> "Sensors":
        """The same with `scale` multiplied in."""
        names = [f"{unit}_{error}" for unit in UNITS for error in _ERRORS]
        names += ["misalignment", "encoder_resolution", "encoder_noise", "contact_noise"]
        most = {
            name: option.kind.most
            for name, option in options_of(Sensors).items()
            if isinstance(option.kind, Number)
        }
        grown = {name: min(self.scale * getattr(self, name), most[name]) for name in names}
        return replace(self, scale=1.0, **grown)


UNITS = ("gyroscope", "accelerometer")
_ERRORS = ("noise", "bias", "drift", "scale")

_MEMS = Sensors(
    gyroscope_noise=radians(0.014),
    gyroscope_bias=10.0 * radians(0.015),
    gyroscope_drift=radians(0.015) / sqrt(100.0),
    gyroscope_scale=0.01,
    gyroscope_range=radians(2000.0),
    accelerometer_noise=175e-6 * _G,
    accelerometer_bias=10.0 * 0.2e-3 * _G,
    accelerometer_drift=0.2e-3 * _G / sqrt(100.0),
    accelerometer_scale=0.005,
    accelerometer_range=24.0 * _G,
    misalignment=radians(0.5),
    encoder_resolution=2.0 * pi / 2**14 / 6.0,
    encoder_noise=radians(0.068) / 6.0,
    encoder_filter=50.0,
    contact_noise=0.02,
    contact_threshold=0.06,
)

PRESETS: dict[str, Sensors] = {
    # VectorNav VN-100: gyroscope 0.0035 °/s/sqrt(Hz), accelerometer 0.14 mg/sqrt(Hz) by its data
    # sheet, as users quote it; 5 to 10 °/h and 0.04 mg in run by that of its sister VN-200
    # (vectornav.com/products/detail/vn-200). Assumed: ranges of ±2000 °/s and ±16 g, axes within
    # 0.05°, scales within 0.1 %, biases as left by calibration ten times those in run; the drifts
    # are those in run over 100 s. Encoders: RLS AksIM-2 on the joint's side
    # (rls.si/eng/aksim-2-off-axis-rotary-absolute-encoder), whose rings have 17 bits and more;
    # assumed: 19 bits, noise of two steps. Feet: a load cell, whose noise of 0.5 % of the weight is
    # assumed.
    "good": Sensors(
        gyroscope_noise=radians(0.0035),
        gyroscope_bias=radians(60.0 / 3600.0),
        gyroscope_drift=radians(6.0 / 3600.0) / sqrt(100.0),
        gyroscope_scale=0.001,
        gyroscope_range=radians(2000.0),
        accelerometer_noise=0.14e-3 * _G,
        accelerometer_bias=0.4e-3 * _G,
        accelerometer_drift=0.04e-3 * _G / sqrt(100.0),
        accelerometer_scale=0.001,
        accelerometer_range=16.0 * _G,
        misalignment=radians(0.05),
        encoder_resolution=2.0 * pi / 2**19,
        encoder_noise=2.0 * 2.0 * pi / 2**19,
        encoder_filter=80.0,
        contact_noise=0.005,
        contact_threshold=0.02,
    ),
    # Bosch BMI088, data sheet (bosch-sensortec.com/media/boschsensortec/downloads/datasheets/
    # bst-bmi088-ds001.pdf, tables of the electrical specification): gyroscope 0.014 °/s/sqrt(Hz),
    # scale ±1 %, ±2000 °/s, 0.015 °/s/K; accelerometer 160 µg/sqrt(Hz), upwards 190, here 175,
    # 0.2 mg/K, ±24 g; here as a robot has it that calibrated it level and at rest, and has become
    # 10 K warmer since. Assumed: scale of the accelerometer ±0.5 %, of which the data sheet has
    # nothing; the trunk warms by 1 K in 100 s, which makes the drifts. Encoders: ams AS5047P, data
    # sheet (ams.com): 14 bits, noise of 0.068° (1 sigma); assumed to sit on the motor's side of a
    # gear of 6, as in MIT's Mini Cheetah. Assumed as well: a rubber foot with a pressure sensor
    # errs by 2 % of the weight, and a board is mounted to half a degree.
    "mems": _MEMS,
    # The same as it comes from the factory, never calibrated: offsets of ±1 °/s and ±20 mg, which
    # is typical by the data sheet; the maker's forum says that typical is one standard deviation.
    "raw": replace(_MEMS, gyroscope_bias=radians(1.0), accelerometer_bias=20e-3 * _G),
}
"""Name -> sensors, with the sources of their numbers."""

PERFECT = "perfect"
LIKE = "like"


def sensors_of(given: Any) -> Sensors | None:
    """Return what `sensors=` means; None for perfect ones, of which nothing is computed.

    Args:
        given: "perfect", the name of a preset, or a table of fields of `Sensors`, in which "like"
            names the preset that has the others; without it they do not err.

    Raises:
        FbidError: no such preset or field, or a value that it does not take.
    """
    if isinstance(given, Mapping):
        table = by_name("sensors", given)
        like = table.pop(LIKE, None)
        base = Sensors() if like is None else PRESETS[_preset(like, PRESETS)]
        check_choices("sensor option", table, (LIKE, *options_of(Sensors)))
        return replace(base, **table)
    name = _preset(given, (PERFECT, *PRESETS))
    return None if name == PERFECT else PRESETS[name]


def _preset(name: Any, known: Any) -> str:
    if not isinstance(name, str) or name not in known:
        raise UnknownOptionError("sensors", name, (*known, "a table of their options"))
    return name
