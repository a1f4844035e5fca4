"""Friction that a law counts on: half of it at first on points, and less while feet slip.

No robot knows the friction of its ground. Forces that the ground does not give are worse than none:
the foot slips, and the body with it. So the law of a robot on points counts on half of its
coefficient at first, or on what its gait needs. Feet that slip can be seen, for they carry and
move: the law then lowers the friction it counts on until they stay, and raises it slowly while they
do, as the ground may be better elsewhere.
"""

import math
from typing import NamedTuple

import numpy as np

from fbid_gym.compiled import compiled
from fbid_gym.dynamics.vectors import add, cross, matrix, scale, turn, vector
from fbid_gym.quantities import ContactGeometry, DynamicsTerms, RobotState

LEAST = 0.2
"""Share of the coefficient that is counted on at least."""

ANY = 1e9  # m/s, of a foot that carries nothing, or of which nothing is known yet
_CARRIES = 0.02  # of the weight
_TELLS = 0.25  # of the weight: a foot that carries less slips for less

# In the time T in which the robot falls, and in g T. With 0.06, 0.1, 0.14 and 0.19 for the speed
# zero actions of base_acceleration return, as robots are built, 573, 609, 607 and 622 on go1, 586,
# 600, 594 and 534 on the biped (-v1, 48 episodes); on ten drawn quadrupeds 368, 371, 362 and 356.
_LOSING, _RECOVERING, _SPEED = 0.15, 12.0, 0.1
# With 0.25, 0.35, 0.5, 0.7 and 1 go1 returns 592, 604, 608, 612, 592, they 383, 384, 384, 384, 365.
FIRST = 0.5  # share of the coefficient that robots on points count on at first

# Times the contacts' own: with 1, 1.5, 2 and 4 go1 on contacts of 20 ms returns 530, 574, 597 and
# 584 as built, the drawn quadrupeds 368, 368, 361 and 358 (with 0.06 for the speed).
_STOPPING = 1.5


class GripModel(NamedTuple):
    """Thresholds of slipping, and the rates at which a law takes notice of it."""

    tick: float  # s, of the law
    speed: float  # m/s up to which a foot that carries only creeps; at twice as much it slips
    slower: float  # share of its speed that a foot that has landed may still have a tick later
    losing: float  # s, time constant of the friction counted on while a foot slips; inf for never
    recovering: float  # s, the same while none does

    @classmethod
    def of(
        cls, falling_rate: float, gravity: float, tick: float, contact_time: float, *, notices: bool
    ) -> "GripModel":
        """Build it for a robot that falls over at a rate (1/s), under a gravity (m/s^2).

        Feet land on contacts that stop them with a time constant of `contact_time` s. None is
        shorter than two steps of the physics, here those of the law.
        """
        time = 1.0 / falling_rate
        losing = _LOSING * time if notices else math.inf
        slower = math.exp(-tick / (_STOPPING * max(contact_time, 2.0 * tick)))
        return cls(tick, _SPEED * gravity * time, slower, losing, _RECOVERING * time)


@compiled
def notice_slip(
    model: GripModel,
    geometry: ContactGeometry,
    gravity: float,
    state: RobotState,
    terms: DynamicsTerms,
    active: np.ndarray,
    allowed: np.ndarray,
    grip: np.ndarray,
) -> None:
    """Update the share of their coefficient of friction that robots count on.

    A foot's speed is that of its centre of pressure, where a sole that tips stays. Feet land with
    some, and slip if they lose it more slowly than contacts stop them, or gain any. `active` (N, P)
    says which points are taken to be on the ground. Speeds that feet may have, `allowed` (N, F)
    m/s, `ANY` for those that carry nothing, and the shares, `grip` (N,), are updated.
    """
    for i in range(len(grip)):
        weight, slips = gravity * terms.mass_matrix[i, 0, 0], 0.0
        for foot in range(allowed.shape[1]):
            load, lever = 0.0, (0.0, 0.0, 0.0)
            for point in range(len(geometry.foot_of_point)):
                if geometry.foot_of_point[point] == foot and active[i, point]:
                    force = max(state.contact_force[i, point, 2], 0.0)
                    load += force
                    lever = add(lever, scale(force, vector(geometry.offset, (point,))))
            if load <= _CARRIES * weight:
                allowed[i, foot] = ANY
                continue
            arm = turn(matrix(terms.world_from_foot, (i, foot)), scale(1.0 / load, lever))
            turning = cross(vector(terms.foot_velocity, (i, foot), 3), arm)
            x, y, _ = add(vector(terms.foot_velocity, (i, foot)), turning)
            speed, most = math.hypot(x, y), max(allowed[i, foot] * model.slower, model.speed)
            tells = min(load / (_TELLS * weight), 1.0)
            slips = max(slips, tells * min(max(speed / most - 1.0, 0.0), 1.0))
            allowed[i, foot] = min(speed, most)
        if slips == 0.0:
            grip[i] += min(model.tick / model.recovering, 1.0) * (1.0 - grip[i])
        else:
            grip[i] = max(grip[i] * math.exp(-model.tick / model.losing * slips), LEAST)
