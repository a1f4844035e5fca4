"""[M10] III-B.6: where Q jumps, the torque of eq. (15) does not."""

from collections.abc import Callable
from typing import Any

import numpy as np

from eval.page.figures import Marks
from eval.papers.experiment import Measured, Setting, experiment
from eval.papers.mistry2010.laws import posed
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.robots import Robot, load

JUMP = 0.5
"""Change of Q (Frobenius norm) from one state to the next that counts as a jump."""

HALVINGS = 30
Walk = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray, np.ndarray]]


@experiment(
    "Claim: torque is continuous where Q is not",
    """Random smooth paths of postures, velocities and commands of the biped with both feet down,
    12 constraints.""",
    minutes=0.3,
)
def claim_continuity(setting: Setting) -> Measured:
    """Walk along smooth paths of states and compare the changes of Q and of the torque."""
    robot = load("biped")
    steps, paths = setting.pick(4001, 1001), setting.pick(8, 3)
    along, found = np.linspace(0.0, 1.0, steps), []
    for seed in setting.each(range(paths)):
        walk = _walk(robot, seed)
        q, literal, ours = _laws(robot, *walk(along))
        change_q = np.linalg.norm(np.diff(q, axis=0), axis=(1, 2))
        change = np.linalg.norm(np.diff(ours, axis=0), axis=1)
        jumps = change_q > JUMP
        found.append(
            {
                "jumps": int(jumps.sum()),
                "largest_q": float(change_q.max()),
                "at_jumps": float(change[jumps].max()) if jumps.any() else 0.0,
                "elsewhere": float(change[~jumps].max()),
                "difference": float(np.abs(literal - ours).max() / np.abs(ours).max()),
            }
        )
        if seed == 0:
            at, first = int(np.argmax(change_q)), {"q": change_q, "torque": change}
            width, jump_q, jump_torque = _zoom(robot, walk, along[at], along[at + 1])
    return {"paths": found, "steps": steps}, {
        **{"along": along[1:], "first": first, "JUMP": JUMP},
        "logarithmic": Marks(logarithmic=True),
        **{"width": width, "halvings": np.log2(width[0] / width), "jump_q": jump_q},
        **{"jump_torque": jump_torque, "least": np.maximum(jump_torque, 1e-14)},
    }


def _walk(robot: Robot, seed: int) -> Walk:
    """A smooth path through states near a squat: from (T,) in [0, 1] to states and commands."""
    rng = np.random.default_rng(seed)
    wide = np.concatenate([np.full(3, 0.1), np.full(3, 0.6), np.full(robot.num_joints, 0.25)])
    sizes = rng.normal(size=(3, 3, robot.nv)) / np.arange(1, 4)[:, None, None]
    phases = rng.uniform(0, 2 * np.pi, (3, 3, robot.nv))

    def walk(along: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        angle = 2 * np.pi * along[:, None, None, None] * np.arange(1, 4)[:, None, None]
        place, rate, command = (sizes * np.sin(angle + phases)).sum(axis=1).swapaxes(0, 1)
        place = place * wide
        qpos = np.tile(robot.home_qpos, (len(along), 1))
        qpos[:, :3] += place[:, :3]
        half = 0.5 * place[:, 3:6]
        size = np.linalg.norm(half, axis=1, keepdims=True)
        qpos[:, 3:7] = np.concatenate([np.cos(size), np.sinc(size / np.pi) * half], axis=1)
        qpos[:, 7:] += place[:, 6:]
        return qpos, 0.5 * rate, 2.0 * command

    return walk


def _laws(
    robot: Robot, qpos: np.ndarray, qvel: np.ndarray, command: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Q by Householder reflections, eq. (15) as printed, and our law: a row for each state."""
    asked, _ = posed(robot, qpos, qvel, command)
    solution = orthogonal_inverse_dynamics(*asked)
    q, _ = np.linalg.qr(asked.jacobian.mT, mode="complete")
    free = q[:, :, asked.jacobian.shape[1] :].mT  # S_u Q^T
    force = np.matvec(asked.mass_matrix, solution.acceleration) + asked.bias
    literal = np.matvec(np.linalg.pinv(free[:, :, 6:]) @ free, force)
    return q, literal, np.asarray(solution.torque)


def _zoom(robot: Robot, walk: Walk, low: float, high: float) -> Any:
    """Halve the interval around a jump of Q; its width, and how Q and the torque change over it."""
    rows = []
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        q, _, torque = _laws(robot, *walk(np.array([low, middle, high])))
        rows.append((high - low, *(np.linalg.norm(x[2] - x[0]) for x in (q, torque))))
        first = np.linalg.norm(q[1] - q[0]) > np.linalg.norm(q[2] - q[1])
        low, high = (low, middle) if first else (middle, high)
    return np.array(rows).T
