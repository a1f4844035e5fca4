"""Identification: contact forces vanish, the truth comes back, and no estimate is impossible."""

from dataclasses import replace

import clarabel
import numpy as np
import pytest
from scipy import sparse

from eval.papers.inertial_parameters.estimation import (
    Samples,
    estimate,
    free_motions,
    projected_equations,
    regression,
    scaled,
)
from eval.papers.inertial_parameters.excitation import natural_steps
from eval.papers.inertial_parameters.inertia import (
    PARAMETERS,
    consistency,
    parameters_of_pseudo_inertia,
    pseudo_inertia,
    with_parameters,
)
from eval.papers.inertial_parameters.regressor import InertialRegressor
from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.contacts import contact_geometry, reduced_contacts

TINY = 1e-13
"""A prior too weak to be seen, for data without noise."""


def identify(robot, samples, **options):
    """The parameters that samples tell of a robot, from nominal ones."""
    regressor = InertialRegressor(robot)
    return estimate(regressor, regression(regressor, samples), **options)


def divergence(found):
    """Entropic divergence D (B,) of the estimated bodies from the nominal ones."""
    relative = np.linalg.solve(
        pseudo_inertia(found.regressor.parameters()), pseudo_inertia(found.parameters)
    )
    sign, size = np.linalg.slogdet(relative)
    assert (sign > 0).all()
    return np.trace(relative, axis1=1, axis2=2) - size - 4.0


def everywhere(samples):
    """The same samples, with every point taken to carry force."""
    return samples._replace(active=np.ones_like(samples.active))


def measured(nominal, samples, rng, share):
    """A regressor and a regression, torques noisy by a share of the limits."""
    noise = share * nominal.torque_limit * rng.normal(size=samples.torque.shape)
    regressor = InertialRegressor(nominal)
    return regressor, regression(regressor, samples._replace(torque=samples.torque + noise))


def wrong(robot, rng, size=0.15):
    """A robot whose bodies are all somewhat different, each by about the same share of itself."""
    regressor = InertialRegressor(robot)
    root = np.linalg.cholesky(pseudo_inertia(regressor.parameters()))
    deform = root @ (np.eye(4) + size * rng.normal(size=root.shape))
    parameters = parameters_of_pseudo_inertia(deform @ deform.mT)
    return with_parameters(robot, regressor.bodies, parameters)


def random_samples(robot, count, rng, planted=None, force=300.0):
    """States and accelerations that random torques and contact forces cause, far from rest.

    Args:
        robot: the true one.
        count: number of samples.
        rng: to draw from.
        planted: (F,) feet that carry force; at random if None.
        force: N, size of the contact forces.
    """
    qpos = rng.normal(size=(count, robot.nq))
    qpos[:, 3:7] /= np.linalg.norm(qpos[:, 3:7], axis=1, keepdims=True)
    qpos[:, 7:] = robot.home_qpos[7:] + 0.4 * rng.normal(size=(count, robot.num_joints))
    qvel = 2.0 * rng.normal(size=(count, robot.nv))
    torque = 0.1 * robot.torque_limit * rng.normal(size=(count, robot.num_joints))
    geometry = contact_geometry(robot)
    if planted is None:
        down = rng.random((count, robot.num_feet)) < 0.6
    else:
        down = np.tile(planted, (count, 1))
    active = down[:, geometry.foot_of_point]
    return with_force(robot, qpos, qvel, torque, active, force, rng)


def with_force(robot, qpos, qvel, torque, active, force, rng):
    """Samples of the accelerations that torques and random contact forces cause."""
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    contacts = reduced_contacts(contact_geometry(robot), terms, active)
    total = np.matvec(contacts.jacobian.mT, force * rng.normal(size=contacts.bias.shape))
    total -= terms.bias
    total[:, 6:] += torque
    qacc = np.linalg.solve(terms.mass_matrix, total[..., None])[..., 0]
    return Samples(qpos, qvel, qacc, torque, active)


def torque_error(robot, other, rng):
    """Largest difference of M a + h of two robots, over the largest value, on motion anew."""
    samples = random_samples(robot, 20, rng)
    rows = InertialRegressor(robot).rows(*samples[:3])
    forces = [rows @ InertialRegressor(r).parameters().ravel() for r in (robot, other)]
    return np.abs(forces[0] - forces[1]).max() / np.abs(forces[0]).max()


@pytest.fixture(scope="module", params=["biped", "quadruped"])
def nominal(request):
    return robots.load(request.param)


@pytest.fixture(scope="module")
def true(nominal):
    return wrong(nominal, np.random.default_rng(7))


@pytest.fixture(scope="module")
def samples(true):
    return random_samples(true, 400, np.random.default_rng(8))


@pytest.fixture(scope="module")
def exact(nominal, samples):
    return identify(nominal, samples, prior_weight=TINY)


# --- the projection ----------------------------------------------------------------------------


def test_free_motions_are_the_null_space_of_the_contacts(rng):
    jacobian = rng.normal(size=(3, 8, 12))
    jacobian[1, 5] = jacobian[1, 2] + jacobian[1, 3]
    jacobian[2, 1:] = 0.0
    rows, count = free_motions(jacobian)
    np.testing.assert_array_equal(count, [4, 5, 11])
    np.testing.assert_allclose(rows @ jacobian.mT, 0.0, atol=1e-12)
    gram = rows @ rows.mT
    np.testing.assert_allclose(gram @ gram, gram, atol=1e-12)
    np.testing.assert_allclose(np.trace(gram, axis1=1, axis2=2), count, atol=1e-12)


def test_contact_forces_do_not_matter(true, samples):
    """The equations hold at the truth, however large the forces that nobody measured."""
    regressor = InertialRegressor(true)
    parameters = regressor.parameters().ravel()
    for force in (0.0, 300.0, 3000.0):
        own = (*samples[:2], samples.torque, samples.active)
        pushed = with_force(true, *own, force, np.random.default_rng(1))
        error = size = 0.0
        for matrix, target, _ in projected_equations(regressor, pushed):
            error = max(error, np.abs(matrix @ parameters - target).max())
            size = max(size, np.abs(target).max())
        assert error < 1e-9 * (size + force)


def test_a_contact_that_is_not_there_only_costs_rows(true, nominal, samples):
    """Taking feet in the air for planted leaves out equations and keeps the others true."""
    every = everywhere(samples)
    regressor = InertialRegressor(nominal)
    data, fewer = regression(regressor, samples), regression(regressor, every)
    assert fewer.rows < data.rows
    parameters = InertialRegressor(true).parameters()
    assert data.residual(parameters) < 1e-9 * np.sqrt(data.square / data.rows)
    assert fewer.residual(parameters) < 1e-9 * np.sqrt(data.square / data.rows)


def test_regression_is_all_that_the_samples_say(nominal, samples, rng):
    regressor = InertialRegressor(nominal)
    data = regression(regressor, samples)
    chunks = list(projected_equations(regressor, samples))
    assert len(chunks) > 1
    parameters = regressor.parameters() * rng.uniform(0.5, 2.0, (len(regressor.bodies), 10))
    square = sum(((m @ parameters.ravel() - t) ** 2).sum() for m, t, _ in chunks)
    count = sum(int(c.sum()) for _, _, c in chunks)
    assert data.rows == count
    assert data.residual(parameters) == pytest.approx(np.sqrt(square / count), rel=1e-9)
    assert data.square == pytest.approx(sum((t**2).sum() for _, t, _ in chunks))


def test_joined_samples(samples):
    parts = slice(150), slice(150, None)
    first, last = (Samples(*(values[part] for values in samples)) for part in parts)
    joined = Samples.joined([everywhere(first), last])
    assert joined.active[:150].all()
    np.testing.assert_array_equal(joined.active[150:], samples.active[150:])
    for name in ("qpos", "qvel", "qacc", "torque"):
        np.testing.assert_array_equal(getattr(joined, name), getattr(samples, name))


# --- the estimate ------------------------------------------------------------------------------


def test_base_parameters_come_back_exactly(nominal, true, exact, samples, rng):
    assert torque_error(true, nominal, rng) > 0.05
    assert torque_error(true, exact.model(), rng) < 1e-8
    regressor = InertialRegressor(nominal)
    own = regression(regressor, samples).residual(regressor.parameters())
    assert exact.residual < 1e-7 * own
    assert exact.consistent
    assert exact.excitation.dimension == exact.excitation.attainable


def test_a_truth_far_from_nominal_comes_back(rng):
    """Bodies many times heavier, longer or shorter in some direction than they are nominally."""
    nominal = robots.load("quadruped")
    regressor = InertialRegressor(nominal)
    deform = np.eye(4) + 0.15 * rng.normal(size=(len(regressor.bodies), 4, 4))
    matrix = deform @ pseudo_inertia(regressor.parameters()) @ deform.mT
    true = with_parameters(nominal, regressor.bodies, parameters_of_pseudo_inertia(matrix))
    found = identify(nominal, random_samples(true, 300, rng), prior_weight=TINY)
    assert divergence(found).sum() > 1000.0
    assert torque_error(true, found.model(), rng) < 1e-6


def test_parameters_told_by_themselves_come_back(true, exact):
    """What the report calls told is the truth; what it calls combined need not be."""
    truth = InertialRegressor(true).parameters()
    scale = np.linalg.norm(natural_steps(exact.regressor.parameters()), axis=2)
    wrong_by = np.abs(exact.parameters - truth) / scale
    # To the share that stays open, of an error of order one.
    told = exact.excitation.open_share < 1e-6
    assert told.sum() > 10
    assert wrong_by[told].max() < 1e-4
    assert wrong_by[exact.excitation.open_share > 0.3].max() > 0.01


@pytest.mark.parametrize("weight", [1e-2, 1e-6, 1e-12])
def test_every_estimate_is_of_bodies_that_can_exist(nominal, samples, rng, weight):
    """Even from noise, where least squares alone is not."""
    shaken = samples._replace(qacc=samples.qacc + 20.0 * rng.normal(size=samples.qacc.shape))
    regressor, data = measured(nominal, shaken, rng, 0.2)
    plain = np.linalg.lstsq(data.matrix, data.target, rcond=1e-9)[0].reshape(-1, 10)
    assert (consistency(plain) <= 0.0).any()
    found = estimate(regressor, data, prior_weight=weight)
    assert found.consistent and (consistency(found.parameters) > 0.0).all()
    assert np.isfinite(divergence(found)).all() and found.model().mass > 0.0


def objective(found, data, weight, change=0.0):
    """What is minimised, as it is documented, away from the estimate by `change`."""
    moved = replace(found, parameters=found.parameters + change)
    error = data.matrix @ moved.parameters.ravel() - data.target
    return (error @ error + data.rest**2) / (2 * data.square) + weight * divergence(moved).sum()


@pytest.mark.parametrize("weight", [1e-1, 1e-4, 1e-6])
def test_the_estimate_is_the_minimum(nominal, samples, rng, weight):
    regressor, data = measured(nominal, samples, rng, 0.1)
    found = estimate(regressor, data, prior_weight=weight)
    least = objective(found, data, weight)
    steps = natural_steps(found.regressor.parameters())
    # A convex function: it rises along a line through the minimum, the same to first order.
    for size in (1e-3, 1e-2):
        for _ in range(10):
            change = size * np.matvec(steps, rng.normal(size=(len(steps), 10)))
            high, low = (objective(found, data, weight, sign * change) for sign in (1, -1))
            assert high > least and low > least
            assert abs(high - low) < 0.2 * (high + low - 2 * least) + 1e-12


def test_a_weak_prior_reaches_the_best_that_can_exist(nominal, samples, rng):
    """Against the semidefinite programme without prior, by another solver."""
    regressor, data = measured(nominal, samples, rng, 0.3)
    found = estimate(regressor, data, prior_weight=1e-8)
    best = semidefinite_least_squares(data, regressor.parameters())
    unconstrained = data.rest / np.sqrt(data.rows)
    assert unconstrained < best <= found.residual * (1 + 1e-6)
    assert found.residual - best < 1e-4 * best


def semidefinite_least_squares(data, nominal):
    """Least residual of parameters with pseudo-inertias P_b >= 0, by Clarabel."""
    count, (steps, effect, error) = len(nominal), scaled(data, nominal)
    # Clarabel's triangle: columns of the upper triangle, off-diagonals times sqrt 2.
    rows, columns = np.triu_indices(4)
    order = np.lexsort((rows, columns))
    rows, columns = rows[order], columns[order]
    scale = np.where(rows == columns, 1.0, np.sqrt(2.0))
    root = np.linalg.cholesky(pseudo_inertia(nominal))
    inverse = np.linalg.inv(root)
    relative = inverse[:, None] @ pseudo_inertia(steps.mT) @ inverse[:, None].mT
    triangle = relative[..., rows, columns] * scale  # (B, 10 steps, 10 entries)
    block = np.zeros((count, 10, count, 10))
    block[np.arange(count), :, np.arange(count)] = triangle.mT
    offset = np.tile(np.eye(4)[rows, columns] * scale, count)
    # Unknowns: the change x and the residual r = A x - b, so that nothing is squared.
    rank = len(effect)
    equality = sparse.hstack([sparse.csc_matrix(effect), -sparse.eye_array(rank)])
    nothing = sparse.csc_matrix((10 * count, rank))
    cone = sparse.hstack([sparse.csc_matrix(-block.reshape(10 * count, -1)), nothing])
    square = sparse.csc_matrix((10 * count, 10 * count)), sparse.eye_array(rank)
    quadratic = sparse.block_diag(square, format="csc")
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1
    solution = clarabel.DefaultSolver(
        quadratic,
        np.zeros(10 * count + rank),
        sparse.vstack([equality, cone], format="csc"),
        np.concatenate([error, offset]),
        [clarabel.ZeroConeT(rank)] + [clarabel.PSDTriangleConeT(4)] * count,
        settings,
    ).solve()
    left = np.array(solution.x[10 * count :])
    return float(np.sqrt((left @ left * data.square + data.rest**2) / data.rows))


def test_a_known_mass_is_kept(nominal, true, samples, rng):
    noisy = samples._replace(qacc=samples.qacc + 10.0 * rng.normal(size=samples.qacc.shape))
    free = identify(nominal, noisy)
    weighed = identify(nominal, noisy, total_mass=true.mass)
    assert abs(free.mass - true.mass) > 1e-3 * true.mass
    assert weighed.mass == pytest.approx(true.mass, rel=1e-9)
    assert weighed.consistent and weighed.residual >= free.residual
    # Against the data, too, and whatever the nominal mass.
    assert identify(nominal, noisy, total_mass=3 * true.mass).consistent


# --- excitation --------------------------------------------------------------------------------


def holding_torque(robot, qpos, qvel, qacc):
    """Least torque for a motion that the feet on the ground allow, eq. (15)."""
    terms = MuJoCoDynamics(robot).terms(qpos, qvel)
    contacts = reduced_contacts(contact_geometry(robot), terms)
    rows, _ = free_motions(contacts.jacobian)
    force = np.matvec(terms.mass_matrix, qacc) + terms.bias
    inverse = np.linalg.pinv(rows[:, :, 6:], rcond=1e-8)
    return np.matvec(inverse, np.matvec(rows, force))


def standing(robot, count):
    """A robot that stands still, and the torque that holds it."""
    qpos = np.tile(robot.home_qpos, (count, 1))
    qvel, qacc = np.zeros((count, robot.nv)), np.zeros((count, robot.nv))
    active = np.ones((count, robot.num_points), bool)
    return Samples(qpos, qvel, qacc, holding_torque(robot, qpos, qvel, qacc), active)


def test_a_robot_that_stands_still_tells_no_more_than_one_sample_can(nominal):
    found = identify(nominal, standing(nominal, 50)).excitation
    assert found.dimension <= nominal.nv - 6 < found.attainable


def test_planted_flat_feet_do_not_tell_their_own_parameters(rng):
    """The ground takes their weight: exactly, and whatever the robot does."""
    robot = robots.load("biped")
    for planted, hidden in (
        ((True, True), {"left_foot", "right_foot"}),
        ((False, True), {"right_foot"}),
        ((False, False), set()),
    ):
        found = identify(wrong(robot, rng), random_samples(robot, 200, rng, planted))
        expected = {f"{foot} {parameter}" for foot in hidden for parameter in PARAMETERS}
        assert set(found.excitation.untold) == expected
        for foot in hidden:  # and they stay what they were
            body, nominal = found.regressor.names.index(foot), found.regressor.parameters()
            np.testing.assert_allclose(found.parameters[body], nominal[body], rtol=1e-9)
            assert divergence(found)[body] == pytest.approx(0.0, abs=1e-12)


def test_joints_that_never_move_hide_their_links(rng):
    """A robot that stands and moves its torso alone tells of the torso and what carries it.

    Turning the pelvis about the hips is a motion that the feet allow, so the hips' torque tells the
    moment of its weight; no leg shows anything of its own.
    """
    robot = robots.load("biped")
    torso = [robot.joint_names.index(name) for name in ("torso_roll", "torso_pitch")]
    qpos, qvel, qacc, _, active = standing(robot, 300)
    qpos[:, 7:][:, torso] += rng.uniform(-0.3, 0.3, (300, 2))
    qvel[:, 6:][:, torso], qacc[:, 6:][:, torso] = 2.0 * rng.normal(size=(2, 300, 2))
    torque = holding_torque(robot, qpos, qvel, qacc)
    found = identify(robot, Samples(qpos, qvel, qacc, torque, active))
    told = found.excitation.told
    assert {name.split()[0] for name in told} == {"torso", "pelvis"}
    assert [name for name in told if name.startswith("pelvis")] == ["pelvis mass x"]
    assert found.excitation.dimension < found.excitation.attainable / 2
    # With the knees bending as well, their links show.
    qpos, qvel, qacc, torque, active = random_samples(robot, 300, rng, (False, True))
    more = identify(robot, Samples(qpos, qvel, qacc, torque, active)).excitation
    assert more.dimension > found.excitation.dimension
    assert any(name.startswith("left_shank") for name in more.told)


def test_names_cover_all_parameters_once(exact):
    report = exact.excitation
    names = [*report.told, *report.combined, *report.untold]
    assert len(names) == len(set(names)) == 10 * len(exact.regressor.names)
    values = report.singular_values
    assert report.condition == pytest.approx(values[0] / values[report.dimension - 1])
    assert (np.diff(values) <= 0.0).all()
