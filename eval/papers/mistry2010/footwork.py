"""Which foot of a biped stands and which one swings, and how the swinging one moves."""

from dataclasses import dataclass

import numpy as np

from eval.papers.trial import Memory

_EARLIEST = 0.6
"""Share of a step's time before which a loaded foot has not left the ground yet, and has not landed
again."""

_SINKS = 0.3
"""m/s at which a foot goes on down that has not found the ground in time."""


@dataclass(frozen=True)
class Footwork:
    """When N bipeds lift and land their two feet.

    Planned steps begin when the motion lifts a foot, or as soon after that as the robot is calm;
    a step that catches a fall begins at once. A foot is down again when it carries a load. One foot
    is in the air at a time.

    Attributes:
        tick: s, of the control.
        planned: s, a planned step's time in the air.
        capture: s, that of a step that catches a fall.
        settled: s that both feet have to be down before one lifts.
        load: N on a foot that count as contact.
    """

    tick: float
    planned: float
    capture: float = 0.2
    settled: float = 0.05
    load: float = 10.0

    def memory(self, planned: np.ndarray) -> Memory:
        """Robots that stand on the feet that the motion plants, (N, 2) bool; others are midway.

        Entries: "swings" (N, 2) bool, in the air; "clock" (N,) s since the last lift; "span" (N,) s
        that this step shall take; "down" (N,) s since the last landing; "due" (N, 2) bool, planned
        steps not taken yet; "plan" (N, 2) bool, what the motion planted on the last tick; "steps"
        and "captures" (N,), how many there were.
        """
        count = len(planned)
        return {
            "swings": ~planned,
            "clock": np.full(count, 0.5 * self.planned),
            "span": np.full(count, self.planned),
            "down": np.where(planned.all(axis=1), self.settled, 0.0),
            "due": np.zeros((count, 2), bool),
            "plan": planned,
            "steps": np.zeros(count),
            "captures": np.zeros(count),
        }

    def advance(
        self,
        planned: np.ndarray,
        load: np.ndarray,
        calm: np.ndarray,
        falls: np.ndarray,
        memory: Memory,
    ) -> None:
        """Go on by one tick.

        Args:
            planned: (N, 2) bool, which feet the motion plants.
            load: (N, 2) N on each foot.
            calm: (N,) bool, whether a robot may begin a planned step.
            falls: (N, 2) bool, which foot has to be lifted at once to catch a fall, if any.
            memory: of `memory`.
        """
        clock = memory["clock"] + self.tick
        landed = (clock > _EARLIEST * memory["span"])[:, None] & (load > self.load)
        swings = memory["swings"] & ~landed
        air = swings.any(axis=1)
        down = np.where(air, 0.0, memory["down"] + self.tick)
        due = (memory["due"] | (memory["plan"] & ~planned)) & ~swings

        ready = ~air & (down > self.settled)
        catch = falls & ready[:, None]
        catching = catch.any(axis=1)
        lift = np.where(catching[:, None], catch, due & (ready & calm)[:, None])
        lift[:, 1] &= ~lift[:, 0]
        lifting = lift.any(axis=1)
        memory["swings"], memory["due"], memory["plan"] = swings | lift, due & ~lift, planned
        memory["clock"], memory["down"] = np.where(lifting, 0.0, clock), down
        span = np.where(catching, self.capture, self.planned)
        memory["span"] = np.where(lifting, span, memory["span"])
        memory["steps"] = memory["steps"] + (lifting & ~catching)
        memory["captures"] = memory["captures"] + catching


def swing(
    position: np.ndarray,
    velocity: np.ndarray,
    target: np.ndarray,
    clock: np.ndarray,
    span: np.ndarray,
    height: float,
    fastest: float,
    shortest: float = 0.04,
) -> np.ndarray:
    """Acceleration that brings feet to their targets in time, lifted on the way.

    That of the cubic that gets there at rest, made anew on every tick, so that the target may move.
    The foot rises for half of the time and comes down in the other half; if it finds no ground, it
    goes on down.

    Args:
        position: (N, 3) m.
        velocity: (N, 3) m/s.
        target: (N, 3) m, on the ground.
        clock: (N,) s since the lift.
        span: (N,) s in the air.
        height: m that the foot is lifted.
        fastest: m/s^2, limit of the result.
        shortest: s in which an error is taken back when there is no time left.

    Returns:
        (N, 3) m/s^2.
    """
    rising = clock < 0.5 * span
    goal = target.copy()
    goal[:, 2] += np.where(rising, height, -_SINKS * np.maximum(clock - span, 0.0))
    left = np.stack([span, span, np.where(rising, 0.5 * span, span)], axis=1) - clock[:, None]
    left = np.maximum(left, shortest)
    wanted = 6.0 * (goal - position) / left**2 - 4.0 * velocity / left
    size = np.linalg.norm(wanted, axis=1, keepdims=True)
    return np.asarray(wanted * np.minimum(1.0, fastest / np.maximum(size, 1e-9)))
