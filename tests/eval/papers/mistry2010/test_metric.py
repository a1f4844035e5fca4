"""Homogeneous metrics on a robot whose legs slide: units must not choose the torque."""

from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from eval.papers.mistry2010.force_feedback import Equation, estimated_force
from eval.papers.mistry2010.metric import metric_inverse_dynamics
from fbid_gym.control import orthogonal_inverse_dynamics
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts
from fbid_gym.robots import Robot

LEG = 0.4  # m
ROTARY = [True, True, False] * 4
MILLIMETRES = 1000.0


def telescopic(unit):
    """Four legs of two hinges and a slide each, all lengths in multiples of 1 m / unit."""

    def length(*values):
        return " ".join(f"{unit * value:.17g}" for value in values)

    def moments(*values):
        return " ".join(f"{unit * unit * value:.17g}" for value in values)

    legs, motors = "", ""
    for number, (x, y) in enumerate(((0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2))):
        legs += f"""
        <body name="hip{number}" pos="{length(x, y, 0.0)}">
          <joint name="roll{number}" axis="1 0 0"/>
          <inertial pos="0 0 0" mass="1" diaginertia="{moments(0.01, 0.01, 0.01)}"/>
          <body name="thigh{number}">
            <joint name="pitch{number}" axis="0 1 0"/>
            <inertial pos="{length(0.0, 0.0, -0.1)}" mass="2"
                diaginertia="{moments(0.02, 0.02, 0.004)}"/>
            <body name="shank{number}" pos="{length(0.0, 0.0, -0.2)}">
              <joint name="slide{number}" type="slide" axis="0 0 1"/>
              <inertial pos="{length(0.0, 0.0, -0.1)}" mass="1.5"
                  diaginertia="{moments(0.01, 0.01, 0.002)}"/>
              <site name="foot{number}" pos="{length(0.0, 0.0, -0.2)}"/>
            </body>
          </body>
        </body>"""
        for joint in ("roll", "pitch", "slide"):
            motors += f'<motor joint="{joint}{number}" ctrlrange="-1 1" gear="{unit * unit}"/>'
    return f"""
    <mujoco>
      <compiler angle="radian"/>
      <option gravity="0 0 {-9.81 * unit:.17g}"/>
      <worldbody>
        <geom name="floor" type="plane" size="{length(10, 10, 1)}"/>
        <body name="trunk">
          <freejoint/>
          <inertial pos="0 0 0" mass="20" diaginertia="{moments(0.4, 0.8, 1.0)}"/>
          {legs}
        </body>
      </worldbody>
      <actuator>{motors}</actuator>
    </mujoco>"""


def length_metric(length):
    """The metric (nv, nv) of this robot in which a radian counts as a length."""
    turns = np.array([False] * 3 + [True] * 3 + ROTARY)
    return np.diag(np.where(turns, length * length, 1.0))


class Case(NamedTuple):
    """The arguments of a law for the same states, in one system of units."""

    law: tuple[np.ndarray, ...]
    velocity_unit: np.ndarray  # (nv,) what 1 m/s or 1 rad/s is in these units


@pytest.fixture(scope="module")
def describe(tmp_path_factory):
    """`describe(unit, consistent)`: a standing robot, moving fast, with a random command."""

    def make(unit, consistent=False):
        path: Path = tmp_path_factory.mktemp("robot") / "telescopic.xml"
        path.write_text(telescopic(unit))
        robot = Robot.from_mjcf(path, feet=[f"foot{number}" for number in range(4)])
        scale = np.array([unit] * 3 + [1.0] * 3 + [1.0 if turns else unit for turns in ROTARY])
        rng = np.random.default_rng(11)
        qpos = np.tile(robot.home_qpos, (5, 1))
        qpos[:, 7:] += rng.normal(0.0, 0.1, (5, 12)) * scale[6:]
        qvel = rng.normal(0.0, 0.5, (5, robot.nv)) * scale
        terms = MuJoCoDynamics(robot).terms(qpos, qvel)
        contacts = reduced_contacts(contact_geometry(robot), terms)
        law = terms.mass_matrix, terms.bias, contacts.jacobian
        command = rng.normal(0.0, 2.0, qvel.shape) * scale
        if consistent:
            # Least in the same metric in all units, so that it is the same command.
            metric = length_metric(LEG * unit)
            held = metric_inverse_dynamics(Equation(*law, command, contacts.bias), metric)
            command = held.acceleration
        return Case((*law, command, contacts.bias), scale)

    return make


def convert(solution, unit, to):
    """A solution in metres, told in other units: torque x velocity is a power."""
    power = to * to
    return solution._replace(
        torque=solution.torque * power / unit[6:],
        acceleration=solution.acceleration * unit,
        contact_force=solution.contact_force * to,
    )


@pytest.mark.parametrize("metric", ["length", "inertia"])
@pytest.mark.parametrize("consistent", [False, True])
def test_with_a_metric_units_do_not_matter(describe, metric, consistent):
    """Torque and achieved acceleration, even for a command that the contacts do not allow."""
    metres, other = describe(1.0, consistent), describe(MILLIMETRES, consistent)
    solutions = []
    for case, unit in ((metres, 1.0), (other, MILLIMETRES)):
        own = length_metric(LEG * unit) if metric == "length" else case.law[0]
        solutions.append(metric_inverse_dynamics(Equation(*case.law), own))
    expected = convert(solutions[0], other.velocity_unit, MILLIMETRES)
    for name in ("torque", "acceleration", "contact_force"):
        there, here = getattr(expected, name), getattr(solutions[1], name)
        np.testing.assert_allclose(here, there, rtol=1e-6, atol=1e-6 * np.abs(there).max())
    np.testing.assert_array_equal(solutions[1].rank, 12)
    np.testing.assert_array_equal(solutions[1].underactuation, 0)


def test_without_a_metric_units_choose_the_torque(describe):
    """The plain law: a tenth or more of the torque depends on how long a metre is."""
    cases = [describe(unit, consistent=True) for unit in (1.0, 10.0)]
    metres, found = (orthogonal_inverse_dynamics(*case.law) for case in cases)
    expected = convert(metres, cases[1].velocity_unit, 10.0)
    np.testing.assert_allclose(found.acceleration, expected.acceleration, atol=1e-6)
    off = np.linalg.norm((found.torque - expected.torque) / expected.torque, axis=1)
    assert (off > 0.1).all()


def test_no_torque_with_the_same_motion_is_cheaper_in_the_metric(make_system, rng, contacts):
    """W = S B^-1 S^T for any B; and the correction of the command is B-orthogonal to motions."""
    system = make_system(contacts)
    count, nv = system.bias.shape
    factor = rng.normal(size=(count, nv, nv + 3))
    metric = factor @ factor.mT / nv  # symmetric, positive definite
    found = metric_inverse_dynamics(Equation(*system.law), metric)
    np.testing.assert_array_equal(found.rank, system.rank)
    np.testing.assert_array_equal(found.underactuation, system.underactuation)
    residual = np.matvec(system.mass_matrix, found.acceleration) + system.bias
    residual -= np.matvec(system.jacobian.mT, found.contact_force)
    residual[:, 6:] -= found.torque
    np.testing.assert_allclose(residual, 0.0, atol=1e-6)
    motion = np.matvec(system.jacobian, found.acceleration) + system.jacobian_bias
    np.testing.assert_allclose(motion, 0.0, atol=1e-8)
    select = np.eye(nv)[6:]
    for i, jacobian in enumerate(system.jacobian):
        stacked = np.concatenate([select.T, jacobian.T], axis=1)
        right = np.linalg.svd(stacked)[2][np.linalg.matrix_rank(stacked, 1e-8) :]
        cost = np.linalg.inv(metric[i])[6:, 6:]
        np.testing.assert_allclose(right[:, : nv - 6] @ cost @ found.torque[i], 0.0, atol=1e-6)
        _, sizes, right = np.linalg.svd(jacobian[:, :6], full_matrices=True)
        beyond = right[int((sizes > 1e-9).sum()) :] @ system.mass_matrix[i, :6]
        fixed = np.concatenate([jacobian, beyond])
        free = np.linalg.svd(fixed)[2][np.linalg.matrix_rank(fixed, 1e-8) :]
        change = metric[i] @ (found.acceleration[i] - system.acceleration[i])
        np.testing.assert_allclose(free @ change, 0.0, atol=1e-6)


def test_a_diagonal_metric_is_a_torque_cost(make_system, rng, contacts):
    """[M10] eq. (16) with W = S B^-1 S^T, once the command is achievable."""
    system = make_system(contacts).achievable()
    metric = np.exp(rng.normal(size=system.bias.shape[1]))
    found = metric_inverse_dynamics(Equation(*system.law), np.diag(metric))
    weighted = orthogonal_inverse_dynamics(*system.law, torque_cost=1.0 / metric[6:])
    np.testing.assert_allclose(found.torque, weighted.torque, atol=1e-6)
    np.testing.assert_allclose(found.acceleration, weighted.acceleration, atol=1e-7)


def test_the_inertia_metric_is_where_previous_torques_lead(make_system):
    """Eq. (8) fed by eq. (6), from no torque: it ends at the least torque in S M^-1 S^T."""
    system = make_system("two flat feet", count=1).achievable()
    expected = metric_inverse_dynamics(Equation(*system.law), system.mass_matrix)
    torque = np.zeros_like(expected.torque)
    for _ in range(3000):
        torque = estimated_force(Equation(*system.law), torque).torque
    np.testing.assert_allclose(torque, expected.torque, atol=1e-3)
    plain = orthogonal_inverse_dynamics(*system.law).torque
    assert np.abs(plain - expected.torque).max() > 1.0
