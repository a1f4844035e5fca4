"""The trials of [G15]'s experiments: robots that balance, and are hit if so wished."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from eval.papers.garofalo2015.pendulum import Bob, Pendulum, world_with_pendulum
from eval.papers.trial import RATES, Disturbance, Plan, Trial, Wanted, height_of
from fbid_gym.control import BalanceTarget, resting_target
from fbid_gym.dynamics import DynamicsTerms, MuJoCoDynamics, centroidal_terms
from fbid_gym.dynamics.frames import rotation_vector
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import Robot


class Goal(NamedTuple):
    """What the robots shall do on one tick.

    Attributes:
        target: of centre of mass and base.
        posture: (n,) or (N, n) rad, of the joints.
        contact_rotation: (N, P, 3, 3) world from contact axes; None for level ground.
    """

    target: BalanceTarget
    posture: np.ndarray
    contact_rotation: np.ndarray | None = None


GoalAt = Callable[[float, DynamicsTerms], Goal]
"""From the time (s) and the dynamics at the start to what the robots shall do."""


def stay(posture: np.ndarray, contact_rotation: np.ndarray | None = None) -> GoalAt:
    """Stay where the robots began, with this posture (n,) rad of the joints."""
    return lambda time, first: Goal(
        resting_target(first.com, first.world_from_base),
        posture,
        contact_rotation=contact_rotation,
    )


def balancing(start: np.ndarray, goal: GoalAt | None = None) -> Plan[Goal]:
    """Return the plan to balance.

    The log gets "com" (T, N, 3) m, centre of mass minus where it shall be; "rotation" (T, N, 3)
    rad, of the base from where it shall be, as a rotation vector; both world; and "momentum"
    (T, N, 6) kg m/s and kg m^2/s about the centre of mass, world.

    Args:
        start: (nq,) where the robots begin; the height is set by the ground.
        goal: what they shall do; None for staying there.
    """

    def begin(simulation: Simulation, ticks: np.ndarray) -> Callable[[np.ndarray], Wanted[Goal]]:
        count, still = simulation.num_robots, np.zeros_like(simulation.qvel)
        simulation.place(np.arange(count), np.tile(start, (count, 1)), still)
        # The simulation's own terms go on with the robots.
        first = MuJoCoDynamics(simulation.robot).terms(simulation.qpos, simulation.qvel)
        goal_at = goal or stay(start[7:])
        height = height_of(first)

        def wanted(tick: np.ndarray) -> Wanted[Goal]:
            now = goal_at(float(tick[0]) / RATES.control, first)

            def seen() -> dict[str, np.ndarray]:
                terms, target = simulation.terms(), now.target
                return {
                    "com": terms.com - target.com,
                    "rotation": rotation_vector(target.world_from_base.mT @ terms.world_from_base),
                    "momentum": centroidal_terms(terms, simulation.qvel.copy()).momentum,
                }

            return Wanted(now, height, seen)

        return wanted

    return begin


class Blow(NamedTuple):
    """One blow of the pendulum for each robot.

    Attributes:
        start: s.
        direction: (N, 3) unit vectors, horizontal, in which the bob flies.
        energy: (N,) J.
    """

    start: float
    direction: np.ndarray
    energy: np.ndarray


def struck(pendulum: Pendulum, blow: Blow) -> Disturbance:
    """Return what hits the robots of a world with this pendulum."""

    def begin(simulation: Simulation) -> Callable[[int], np.ndarray]:
        bob, every = Bob(simulation, pendulum), np.arange(simulation.num_robots)
        hit, no_push = round(blow.start * RATES.control), np.zeros((len(every), 3))

        def swing(step: int) -> np.ndarray:
            bob.catch()
            if step == hit:
                bob.swing(every, blow.direction, blow.energy)
            return no_push

        return swing

    return begin


def bout(
    robot: Robot, pendulum: Pendulum, blow: Blow, seconds: float, **options: Any
) -> Trial[Goal]:
    """Return a trial of robots that stand at home and are hit; `options` are a `Trial`'s."""
    world, plan = world_with_pendulum(robot, pendulum), balancing(robot.home_qpos)
    given = {"num_robots": len(blow.energy), "world": world, "disturb": struck(pendulum, blow)}
    return Trial(robot, plan, seconds, **given, **options)
