"""Observations and actions in the mirror: what the robot's reflection would see, and would do.

Found from the names of the entries: a name says which part of the robot it is of, and along which
axis. What is good to do is good in the mirror, so a learner may use both.
"""

import re
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.errors import InvalidValueError
from fbid_gym.robots.mirror import Reflection, mirror_of
from fbid_gym.runtime.observer import POLICY

_WAY = "(ahead|to the left|up|[xyz])"
_PART = (
    r"(.+) (?:planned to stand|told to be on the ground) \(.*",
    r"normal force on ((?:foot|point) \d+) \(.*",
    r"next foothold of (.+), (?P<along>ahead|to the left) \(.*",
    rf"target of (.+) (?P<along>{_WAY}), trunk \(.*",
)
_JOINT = (
    r"(.+) (?:position from home|velocity|last torque) \((?:rad|rad/s|share of its limit)\)",
    r"target of (.+) from its reference \(.*",
    r"(?:acceleration|torque) of (.+) \(x .*",
)
_ABOUT = (
    rf"(?:base angular velocity|base angular acceleration|gyroscope) (?P<about>{_WAY})\b.*",
    rf"rotation of the body, base (?P<about>{_WAY})\b.*",
    rf"moment (?P<about>{_WAY}) about the centre of mass\b.*",
    r"(?:commanded )?(?P<odd>yaw rate)\b.*",
)
_ALONG = (
    rf"(?:base|base velocity|base acceleration|accelerometer|up direction) (?P<along>{_WAY})\b.*",
    rf"(?:commanded velocity|velocity|force|target of the body) (?P<along>{_WAY})\b.*",
)
_EVEN = (r"(commanded |)height\b.*", r"frequency of the gait\b.*", r".*\bpriority\b.*")
_CLOCK = (r"(?P<clock>sine|cosine) of the gait's cycle\b.*",)
_SCAN = r"(ground \S+ m ahead, )(-?)(\S+)( m to the left .*)"
_AROUND = r"(actual )?(.*?)(, \d+ steps ago)?"


class Mirrored(NamedTuple):
    """Observations and actions of environments in the mirror."""

    observation: Reflection  # of the policy's part, without what its critic knows beside
    action: Reflection


def mirrored(batch: EnvBatch) -> Mirrored:
    """Return what the mirror makes of the observations and actions of environments.

    Raises RobotError for a robot without mirror symmetry, InvalidValueError for an entry of which
    is not known what it is in the mirror.
    """
    names, seen = _Names(batch), batch.observation_columns.get(POLICY, slice(None))
    return Mirrored(
        names.reflection("observation", batch.observation_names[seen]),
        names.reflection("action", batch.action_names),
    )


class _Names:
    """Mirrored names."""

    def __init__(self, batch: EnvBatch) -> None:
        robot, mirror = batch.robot, mirror_of(batch.robot)
        names, feet, entry = robot.joint_names, robot.foot_names, mirror.feet.entry
        pairs = zip(names, mirror.joints.entry, mirror.joints.sign, strict=True)
        parts = {foot: feet[k] for foot, k in zip(feet, entry, strict=True)}
        parts |= {f"foot {k}": f"foot {other}" for k, other in enumerate(entry)}
        parts |= {f"point {k}": f"point {other}" for k, other in enumerate(mirror.points.entry)}
        self._parts = parts
        self._joints = {name: (names[k], float(sign)) for name, k, sign in pairs}
        self._clock = _half_a_cycle(batch, entry)  # sign of the gait's cycle: -1 half a cycle later

    def reflection(self, what: str, names: Sequence[str]) -> Reflection:
        """Return the reflection of the entries of these names."""
        place = {name: k for k, name in enumerate(names)}
        entry, sign = [], []
        for name in names:
            other, its_sign = self._of_name(name) or ("", 1.0)
            if other not in place:
                expected = "entries whose mirror image is known; or no mirror"
                raise InvalidValueError(f"entry of the {what} to mirror", name, expected)
            entry.append(place[other])
            sign.append(its_sign)
        return Reflection(np.array(entry), np.array(sign))

    def _of_name(self, whole: str) -> tuple[str, float] | None:
        """Return name and sign of an entry's counterpart; None where they are not known."""
        around = re.fullmatch(_AROUND, whole)
        assert around is not None
        before, name, after = (part or "" for part in around.groups())
        if seen := re.fullmatch(_SCAN, name):
            first, minus, aside, last = seen.groups()
            minus = "" if minus or not float(aside) else "-"
            return f"{before}{first}{minus}{aside}{last}{after}", 1.0
        for pattern in (*_PART, *_JOINT, *_ABOUT, *_ALONG, *_EVEN, *_CLOCK):
            if (match := re.fullmatch(pattern, name)) is None:
                continue
            sign = self._sign(match.groupdict())
            if pattern in (*_PART, *_JOINT):
                part, sign_of_part = self._joints.get(match[1], (self._parts.get(match[1]), 1.0))
                if part is None:
                    continue
                sign *= sign_of_part
                name = f"{name[: match.start(1)]}{part}{name[match.end(1) :]}"
            return f"{before}{name}{after}", sign
        return None

    def _sign(self, of: Mapping[str, str]) -> float:
        if "clock" in of:
            return self._clock
        along, about, across = of.get("along"), of.get("about"), {"to the left", "y"}
        return -1.0 if along in across or (about or "y") not in across or "odd" in of else 1.0


def _half_a_cycle(batch: EnvBatch, partner: np.ndarray) -> float:
    """Return -1 where feet of the other side step half a cycle later, 1 where they do together."""
    gait = getattr(batch.task, "gait", None)
    schedule = getattr(getattr(gait, "constants", None), "schedule", None)
    if schedule is None:  # two feet, one after the other
        return -1.0
    later = np.cos(2.0 * np.pi * (schedule.lift[partner] - schedule.lift))
    if np.ptp(later) > 1e-9 or abs(abs(later[0]) - 1.0) > 1e-9:
        expected = "one whose left feet step with the right ones, or half a cycle later"
        raise InvalidValueError("gait to mirror", schedule.lift.tolist(), expected)
    return float(np.sign(later[0]))
