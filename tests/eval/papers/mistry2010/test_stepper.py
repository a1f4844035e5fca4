"""Our stepping controller: it squats, steps when it is time, and holds what others do not."""

import numpy as np
import pytest

from eval.papers.mistry2010.controllers import following
from eval.papers.mistry2010.stepper import Stepper
from eval.papers.mistry2010.stepping import MOTIONS, OURS, controller
from eval.papers.trial import RATES, Trial, pushed, simulate
from fbid_gym.envs.simulation import Simulation
from fbid_gym.motions import stepping
from fbid_gym.motions.gait.biped import DOUBLE, STAND, SWING
from fbid_gym.quantities import RobotState

CROUCHED = MOTIONS["crouched"]


def test_a_step_is_taken_with_each_foot_and_the_squat_goes_on(robot):
    watched = ("steps", "captures", "phase", "carrier")
    trial = Trial(robot, following(stepping(robot, CROUCHED)), 3.0, watch=watched)
    stepper = Stepper(robot, CROUCHED)
    log = simulate(trial, stepper)
    assert log.survived.all()
    assert log["steps"][-1] == 2 and log["captures"][-1] == 0
    # The left foot lifts at a quarter of the period, the right one at three quarters.
    for foot, moment in ((0, 0.75), (1, 2.25)):
        air = (log["phase"][:, 0] == SWING) & (log["carrier"][:, 0] == 1 - foot)
        assert abs(log.time[air].mean() - moment) < 0.25
        assert 0.05 < np.ptp(log.time[air]) < 0.3
        unloaded = log["contact_force"][air, 0, 4 * foot : 4 * foot + 4, 2].sum(axis=1) == 0.0
        assert unloaded.mean() > 0.5
    height = stepper.plan.reference(np.arange(len(log.time))).qpos[:, 2]
    late = log.time > 0.5
    assert np.ptp(height) > 0.05
    np.testing.assert_allclose(log["qpos"][late, 0, 2], height[late], atol=0.01)


@pytest.mark.parametrize("speed", [0.0, 0.2])
def test_a_planned_step_waits_until_the_robot_is_calm(robot, speed):
    simulation, stepper = Simulation(robot, 1, RATES), Stepper(robot, CROUCHED)
    due = np.flatnonzero(~stepper.plan.reference(np.arange(stepper.plan.period)).planted[:, 0])[:1]
    plan = stepper.plan.reference(np.zeros(1, np.int64))  # the base between the feet
    qvel = np.zeros((1, robot.nv))
    qvel[:, 1] = speed
    simulation.place(np.arange(1), plan.qpos, qvel)
    memory = stepper.memory(1)
    for tick in (due - 1, due):
        force = simulation.contact_force
        state = RobotState(simulation.qpos.copy(), simulation.qvel.copy(), force, tick)
        stepper(state, simulation.terms(), plan, memory)
    assert memory["due"].tolist() == [[True, False]]
    # Standing, or on the way to the right foot.
    assert memory["phase"] == (STAND if speed else DOUBLE)
    assert speed or memory["carrier"] == 1


@pytest.mark.slow
def test_it_takes_200_newtons_where_the_papers_controller_falls(robot):
    angle = np.pi * np.array([0.0, 0.5, 1.0, 1.5])
    force = 200.0 * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    push = pushed(np.full((4, 1), 0.4), force[:, None], 0.15)
    plan, start = following(stepping(robot, CROUCHED)), np.array([0.0, 0.3, 1.0, 1.8])
    trial = Trial(robot, plan, 3.0, 4, start=start, disturb=push, watch=("steps",))
    log = simulate(trial, controller(robot, "crouched", OURS))
    assert log.survived.all()
    assert (log["steps"][-1] >= 1).all()
