"""The law alone, in your own loop with plain MuJoCo: a biped squats on feet that cannot pull."""

import argparse
from collections.abc import Sequence

import mujoco
import numpy as np

from fbid_gym.control import ContactLimits, limited_inverse_dynamics
from fbid_gym.robots import Foot, load


def contacts(model: mujoco.MjModel, data: mujoco.MjData, feet: Sequence[Foot]):
    """Return J (3P, nv) of the points on the feet, and its rate times the velocity (3P,)."""
    rows, rates = [], []
    for foot in feet:
        for point in foot.points:
            place = data.xpos[foot.body] + data.xmat[foot.body].reshape(3, 3) @ point
            row, rate = np.zeros((3, model.nv)), np.zeros((3, model.nv))
            mujoco.mj_jac(model, data, row, None, place, foot.body)
            mujoco.mj_jacDot(model, data, rate, None, place, foot.body)
            rows.append(row)
            rates.append(rate @ data.qvel)
    return np.concatenate(rows), np.concatenate(rates)


def main(steps: int) -> None:
    """Squat for a number of ticks of 2 ms."""
    robot = load("biped")  # yours: any mujoco.MjModel whose first joint is free
    model, data = robot.model, mujoco.MjData(robot.model)
    model.opt.timestep = 0.002
    data.qpos = home = robot.home_qpos
    mass, warm = np.empty((model.nv, model.nv)), None
    for step in range(steps):
        mujoco.mj_forward(model, data)
        mujoco.mj_fullM(model, data, mass)
        jacobian, bias = contacts(model, data, robot.feet)
        # What the robot shall do: the base bobs, everything returns to where it was.
        wanted = np.zeros(model.nv)
        mujoco.mj_differentiatePos(model, wanted, 1.0, data.qpos, home)
        wanted[2] -= 0.05 * (1 - np.cos(np.pi * data.time))
        acceleration = 60.0 * wanted - 15.0 * data.qvel
        batch = (a[None] for a in (mass, data.qfrc_bias, jacobian, acceleration, bias))
        law = limited_inverse_dynamics(
            *batch, ContactLimits(friction=0.7), base_priority=1e3, warm_start=warm
        )
        warm = law.warm_start
        data.ctrl = law.torque[0]
        mujoco.mj_step(model, data)
        if step % 100 == 99:
            normal = law.point_force[0, :, 2]
            print(f"{data.time:.1f} s: base at {data.qpos[2]:.3f} m, {normal.sum():.0f} N")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=2000)
    main(parser.parse_args().steps)
