"""By how much an estimate errs."""

import numpy as np

from fbid_gym.compiled import compiled, kernel
from fbid_gym.dynamics.rotations import rotation_at
from fbid_gym.dynamics.vectors import cross, dot, subtract, vector
from fbid_gym.quantities import RobotState

ERRORS = {
    "estimate_tilt_error": "rad, between the vertical and what the robot takes for it",
    "estimate_velocity_error": "m/s, of the base, along the robot's own heading",
    "estimate_height_error": "m, of the base; it drifts from step to step",
    "estimate_heading_error": "rad; no sensor tells it, it drifts",
    "estimate_drift": "m, horizontally, since the episode began; it drifts as well",
    "estimate_contact_error": "share of the feet whose contact is told wrong",
    "estimate_restarts": "how often the estimate was lost and begun anew in this episode",
}
"""Entries of the info, with their unit."""

_TILT, _VELOCITY, _HEIGHT, _HEADING, _DRIFT, _CONTACT = range(6)  # the first of them


@kernel
def find_errors(
    actual: RobotState,
    seen: RobotState,
    foot_of_point: np.ndarray,
    threshold: float,
    contact: np.ndarray,
) -> np.ndarray:
    """Compare where robots are with where they believe to be, `seen`.

    A foot with its points, `foot_of_point` (P,) int64, stands on more than the threshold, N; which
    feet are told to, `contact` (N, F) bool says. Returns the first of `ERRORS`, (6, N).
    """
    count, feet = contact.shape
    errors = np.zeros((6, count))
    _compare(actual, seen, foot_of_point, threshold, contact, errors, np.empty(feet))
    return errors


@compiled
def _compare(
    actual: RobotState,
    seen: RobotState,
    foot_of_point: np.ndarray,
    threshold: float,
    contact: np.ndarray,
    errors: np.ndarray,
    load: np.ndarray,
) -> None:
    """Write the errors; `load` (F,) is a buffer."""
    for i in range(len(contact)):
        true, own = rotation_at(actual.qpos, i, 3), rotation_at(seen.qpos, i, 3)
        aside = cross(true[2], own[2])
        errors[_TILT, i] = np.arctan2(np.sqrt(dot(aside, aside)), dot(true[2], own[2]))
        # True heading to own, about the vertical: of own true^T.
        turned = dot(own[1], true[0]) - dot(own[0], true[1])
        angle = np.arctan2(turned, dot(own[0], true[0]) + dot(own[1], true[1]))
        errors[_HEADING, i] = angle
        cosine, sine = np.cos(angle), np.sin(angle)
        x, y, z = vector(actual.qvel, (i,))
        along = (cosine * x - sine * y, sine * x + cosine * y, z)
        off = subtract(vector(seen.qvel, (i,)), along)
        errors[_VELOCITY, i] = np.sqrt(dot(off, off))
        away = subtract(vector(seen.qpos, (i,)), vector(actual.qpos, (i,)))
        errors[_HEIGHT, i], errors[_DRIFT, i] = away[2], np.hypot(away[0], away[1])
        for foot in range(len(load)):
            load[foot] = 0.0
        for point in range(len(foot_of_point)):
            load[foot_of_point[point]] += actual.contact_force[i, point, 2]
        for foot in range(len(load)):
            errors[_CONTACT, i] += ((load[foot] > threshold) != contact[i, foot]) / len(load)
