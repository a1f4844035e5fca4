"""The trials of [G15]'s experiments: robots that balance, and are hit if so wished."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from eval.papers.garofalo2015.pendulum import Bob, PendulumBlow, world_with_pendulum
from eval.papers.log import Log
from eval.papers.trial import RATES, Disturbance, Plan, Trial, Wanted, height_of
from fbid_gym.control import BalanceTarget, resting_target
from fbid_gym.dynamics import DynamicsTerms, MuJoCoDynamics, centroidal_terms
from fbid_gym.dynamics.frames import rotation_vector
from fbid_gym.envs.simulation import Simulation
from fbid_gym.robots import Robot

SIDEWAYS = np.array([[0.0, 1.0, 0.0]])
IMPACT = 0.1
"""s after the pendulum is let go during which it may touch."""

SETTLED = 0.1
"""Share of its peak below which an error has settled."""


class Goal(NamedTuple):
    """Desired motion of the robots on one tick."""

    target: BalanceTarget  # of centre of mass and base
    posture: np.ndarray  # (n,) or (N, n) rad, of the joints
    contact_rotation: np.ndarray | None = None
    """(N, P, 3, 3) world from contact axes; None for level ground."""


GoalAt = Callable[[float, DynamicsTerms], Goal]
"""From the time (s) and the dynamics at the start to what the robots shall do."""


def stay(posture: np.ndarray, rotation: np.ndarray | None = None) -> GoalAt:
    """Stay where the robots began, with this posture (n,) rad, on contacts turned so; see Goal."""
    return lambda _, first: Goal(
        resting_target(first.com, first.world_from_base), posture, rotation
    )


def balancing(start: np.ndarray, goal: GoalAt | None = None) -> Plan:
    """Return the plan to balance.

    The log gets "com" (T, N, 3) m, centre of mass minus where it shall be; "rotation" (T, N, 3)
    rad, of the base from where it shall be, as a rotation vector; both world; and "momentum"
    (T, N, 6) kg m/s and kg m^2/s about the centre of mass, world.

    Args:
        start: (nq,) where the robots begin; the height is set by the ground.
        goal: what they shall do; None for staying there.
    """

    def begin(simulation: Simulation, ticks: np.ndarray) -> Callable[[np.ndarray], Wanted]:
        count, still = simulation.num_robots, np.zeros_like(simulation.qvel)
        simulation.place(np.arange(count), np.tile(start, (count, 1)), still)
        # The simulation's own terms go on with the robots.
        first = MuJoCoDynamics(simulation.robot).terms(simulation.qpos, simulation.qvel)
        goal_at, height = goal or stay(start[7:]), height_of(first)

        def wanted(tick: np.ndarray) -> Wanted:
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
    """One blow of the pendulum for each robot."""

    start: float  # s
    direction: np.ndarray  # (N, 3) unit vectors, horizontal, in which the bob flies
    energy: np.ndarray  # (N,) J


def struck(pendulum: PendulumBlow, blow: Blow) -> Disturbance:
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


def bout(robot: Robot, pendulum: PendulumBlow, blow: Blow, seconds: float, **options: Any) -> Trial:
    """Return a trial of robots that stand at home and are hit; `options` are a `Trial`'s."""
    world, plan = world_with_pendulum(robot, pendulum), balancing(robot.home_qpos)
    given = {"num_robots": len(blow.energy), "world": world, "disturb": struck(pendulum, blow)}
    return Trial(robot, plan, seconds, **given, **options)


def settling_time(time: np.ndarray, error: np.ndarray) -> float:
    """Return how many s after the first sample an error (T,) last exceeds a tenth of its peak."""
    large = np.flatnonzero(np.abs(error) > SETTLED * np.abs(error).max())
    return float(time[large[-1]] - time[0])


def blow_numbers(log: Log, start: float, index: int = 0) -> dict[str, Any]:
    """Return peaks and settling times of one robot after a blow at `start` s, as JSON can hold it.

    Returns:
        com, rotation (3 each, m and rad): peaks of the errors; linear, angular (kg m/s,
        kg m^2/s): peaks of the momenta along their largest axis; com_settled, rotation_settled (s):
        of the largest axis; unrealised (2, N and N m): rms of what the momentum's rate lacks of
        the wrench that was wanted, after the blow; fell: s or None.
    """
    numbers: dict[str, Any] = {}
    after = log.time >= start
    for name in ("com", "rotation"):
        error = log[name][after, index]
        peaks = np.abs(error).max(axis=0)
        settled = settling_time(log.time[after], error[:, int(peaks.argmax())])
        numbers |= {name: peaks.tolist(), f"{name}_settled": settled}
    momentum = np.abs(log["momentum"][after, index])
    return numbers | {
        "linear": float(momentum[:, :3].max()),
        "angular": float(momentum[:, 3:].max()),
        "unrealised": unrealised(log, start + IMPACT, index),
        "fell": log.fall(index),
    }


def unrealised(log: Log, since: float, index: int = 0) -> list[float]:
    """Return rms force (N) and moment (N m) by which a momentum's rate missed the wanted wrench.

    The rate is a central difference of the logged momenta.
    """
    rate = np.gradient(log["momentum"][:, index].astype(float), log.time, axis=0)
    error = rate - log["desired"][:, index]
    # What carries the weight is in the wrench, but does not change the momentum.
    error[:, 2] += log["desired"][0, index, 2]
    error = error[log.time >= since]
    parts = error[:, :3], error[:, 3:]
    return [float(np.sqrt(np.mean(np.sum(part**2, axis=1)))) for part in parts]
