"""How much friction a law counts on: less while feet slip.

No robot knows the friction of the ground it walks on. Forces that the ground does not give are
worse than none: the foot slips, and the body with it. Feet that slip can be seen, for they carry
and move: a robot's law then lowers the friction it counts on until they stay, and raises it slowly
afterwards, as the ground may be better elsewhere.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.vectors import add, cross, matrix, scale, turn, vector
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, RobotState

LEAST = 0.2
"""Share of the coefficient that is counted on at least."""

_CARRIES = 0.02  # of the weight
_TELLS = 0.25  # of the weight: a foot that carries less slips for less

# In the time T in which the robot falls, and in g T. With the long trot QuadrupedWalk-v1 returns
# 629 with these (64 episodes), 591 to 634 with half or one and a half times the speed or half or
# twice the time of losing, 569 where recovering takes ten times as long, 506 with twice the time of
# landing, 390 without notice.
_LANDING, _LOSING, _RECOVERING, _SPEED = 0.06, 0.15, 12.0, 0.06

_SOFT = 0.05  # in T: contacts that take longer are soft


class GripModel(NamedTuple):
    """When feet slip, and how fast a law takes notice."""

    tick: float  # s, of the law
    landing: float  # s that a foot carries before its speed counts, as feet land with some
    speed: float  # m/s up to which a foot that carries only creeps; at twice as much it slips
    losing: float  # s, time constant of the friction counted on while a foot slips; inf for never
    recovering: float  # s, the same while none does

    @classmethod
    def of(
        cls, falling_rate: float, gravity: float, tick: float, contact_time: float, *, notices: bool
    ) -> "GripModel":
        """Build it for a robot that falls over at a rate (1/s), under a gravity (m/s^2).

        On contacts with a time constant of `contact_time` s, if that is long, feet land for longer
        and creep faster. None is harder than two steps of the physics, here those of the law.
        """
        time = 1.0 / falling_rate
        losing = _LOSING * time if notices else math.inf
        softer = max(contact_time / max(_SOFT * time, 2.0 * tick), 1.0)
        landing, speed = _LANDING * time * softer, _SPEED * gravity * time * softer
        return cls(tick, landing, speed, losing, _RECOVERING * time)


@compiled
def notice_slip(
    model: GripModel,
    geometry: ContactGeometry,
    gravity: float,
    state: RobotState,
    terms: DynamicsTerms,
    active: np.ndarray,
    carried: np.ndarray,
    grip: np.ndarray,
) -> None:
    """Update the share of their coefficient of friction that robots count on.

    A foot's speed is that of its centre of pressure, where a sole that tips stays. `active` (N, P)
    says which points are taken to be on the ground. The seconds for which feet have `carried`
    (N, F) and the shares, `grip` (N,), are updated.
    """
    for i in range(len(grip)):
        weight, slips = gravity * terms.mass_matrix[i, 0, 0], 0.0
        for foot in range(carried.shape[1]):
            load, lever = 0.0, (0.0, 0.0, 0.0)
            for point in range(len(geometry.foot_of_point)):
                if geometry.foot_of_point[point] == foot and active[i, point]:
                    force = max(state.contact_force[i, point, 2], 0.0)
                    load += force
                    lever = add(lever, scale(force, vector(geometry.offset, (point,))))
            carries = load > _CARRIES * weight
            carried[i, foot] = carried[i, foot] + model.tick if carries else 0.0
            if carried[i, foot] > model.landing:
                arm = turn(matrix(terms.world_from_foot, (i, foot)), scale(1.0 / load, lever))
                turning = cross(vector(terms.foot_velocity, (i, foot), 3), arm)
                x, y, _ = add(vector(terms.foot_velocity, (i, foot)), turning)
                tells = min(load / (_TELLS * weight), 1.0)
                slips = max(slips, tells * min(max(math.hypot(x, y) / model.speed - 1.0, 0.0), 1.0))
        if slips == 0.0:
            grip[i] += min(model.tick / model.recovering, 1.0) * (1.0 - grip[i])
        else:
            grip[i] = max(grip[i] * math.exp(-model.tick / model.losing * slips), LEAST)
