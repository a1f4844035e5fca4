"""The filter against a dense one in NumPy, finite differences, chi-square bounds, invariances.

Robots here have a foot on three slides, so that joint positions are where the foot is seen.
"""

import numpy as np
import pytest
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation
from scipy.stats import chi2

from fbid_gym.dynamics.frames import skew
from fbid_gym.estimation.correction import update
from fbid_gym.estimation.invariant_filter import Belief, Filter
from fbid_gym.estimation.legs import Legs, Mounting
from fbid_gym.estimation.linear_filter import update_linear
from fbid_gym.estimation.prediction import predict
from fbid_gym.estimation.sensing import Readings
from fbid_gym.quantities import RobotState

FEET, HZ, G = 3, 250, 9.81
SIZE = 15 + 3 * FEET
LEGS = Legs(
    joint=np.arange(3 * FEET, dtype=np.int64).reshape(FEET, 3),
    hinge=np.zeros((FEET, 3), bool),
    axis=np.tile(np.eye(3), (FEET, 1, 1)),
    anchor=np.zeros((FEET, 3, 3)),
    foot=np.zeros((FEET, 3)),
    radius=np.zeros(FEET),
)
OWN = Filter(
    tick=1.0 / HZ, every=1, gravity=G, turning=(1e-3) ** 2 / HZ, pushing=(2e-2) ** 2 / HZ,
    gyroscope_drift=(1e-3) ** 2 / HZ, accelerometer_drift=(1e-2) ** 2 / HZ,
    slipping=(5e-3) ** 2 / HZ, placing=0.0, encoder=(1e-3) ** 2, threshold=1.0, gate=1e9,
    tilt_variance=0.02**2, velocity_variance=0.1**2, gyroscope_variance=0.02**2,
    accelerometer_variance=0.2**2, fastest=50.0, vaguest=100.0, patience=50, settle=0.02,
    leaning=0.5, mounting=Mounting(np.zeros(3), np.eye(3), np.array([1.0, 0.0, 0.0])),
    foot_of_point=np.arange(FEET), points=np.ones(FEET),
)  # fmt: skip


def exponential(xi):
    """SE_{2+F}(3) of (xi_R, xi_v, xi_p, xi_d ...), by the matrix exponential."""
    wedge = np.zeros((5 + FEET, 5 + FEET))
    wedge[:3, :3] = skew(xi[:3])
    wedge[:3, 3:] = np.concatenate([xi[3:9], xi[15:]]).reshape(-1, 3).T
    return expm(wedge)


def logarithm(matrix):
    wedge = np.real(logm(matrix))
    found = np.zeros(SIZE)
    found[:3] = wedge[2, 1], wedge[0, 2], wedge[1, 0]
    columns = wedge[:3, 3:].T.ravel()
    found[3:9], found[15:] = columns[:6], columns[6:]
    return found


def element(belief, i):
    """X of a robot's belief."""
    found = np.eye(5 + FEET)
    found[:3, :3] = Rotation.from_quat(np.roll(belief.quaternion[i], -1)).as_matrix()
    found[:3, 3], found[:3, 4] = belief.velocity[i], belief.position[i]
    found[:3, 5:] = belief.foot[i].T
    return found


def believe(belief, i, matrix, gyroscope=0.0, accelerometer=0.0):
    belief.quaternion[i] = np.roll(Rotation.from_matrix(matrix[:3, :3]).as_quat(), 1)
    belief.velocity[i], belief.position[i] = matrix[:3, 3], matrix[:3, 4]
    belief.foot[i] = matrix[:3, 5:].T
    belief.gyroscope_bias[i], belief.accelerometer_bias[i] = gyroscope, accelerometer
    belief.lost[i], belief.standing[i] = False, True


def error_of(belief, i, matrix, gyroscope, accelerometer):
    """(xi, zeta) of a belief against the truth."""
    found = logarithm(element(belief, i) @ np.linalg.inv(matrix))
    found[9:12] = belief.gyroscope_bias[i] - gyroscope
    found[12:15] = belief.accelerometer_bias[i] - accelerometer
    return found


def state(count):
    joints = 3 * FEET
    shapes = (count, 7 + joints), (count, 6 + joints), (count, FEET, 3)
    return RobotState(*map(np.zeros, shapes), np.zeros(count, np.int64))


def somewhere(rng):
    return exponential(0.7 * rng.standard_normal(SIZE))


def transition(matrix, spin, dt):
    """Phi of the docstring's equations, dense; R that of the middle of the tick."""
    a = np.zeros((SIZE, SIZE))
    middle = matrix[:3, :3] @ Rotation.from_rotvec(0.5 * dt * spin).as_matrix()
    a[3:6, :3], a[6:9, 3:6] = skew(np.array([0.0, 0.0, -G])), np.eye(3)
    a[:3, 9:12], a[3:6, 12:15] = -middle, -middle
    for row, column in ((3, 3), (6, 4), *((15 + 3 * k, 5 + k) for k in range(FEET))):
        a[row : row + 3, 9:12] = -skew(matrix[:3, column]) @ middle
    return expm(a * dt)


def test_how_errors_grow_is_what_finite_differences_say(rng):
    """Phi, column by column: a belief that errs by a little, a tick later."""
    small, truth = 1e-5, somewhere(rng)
    spin, force = rng.standard_normal(3), rng.standard_normal(3) + [0.0, 0.0, G]
    belief = Belief.none(1 + 2 * SIZE, FEET, SIZE)
    readings = Readings.none(1 + 2 * SIZE, 3 * FEET, FEET)
    readings.gyroscope[:], readings.accelerometer[:] = spin, force
    believe(belief, 0, truth)
    for k in range(SIZE):
        for side, row in ((small, 1 + 2 * k), (-small, 2 + 2 * k)):
            xi = np.zeros(SIZE)
            xi[k] = side
            believe(belief, row, exponential(xi) @ truth, xi[9:12], xi[12:15])
    belief.covariance[0] = np.eye(SIZE)
    quiet = OWN._replace(turning=0.0, pushing=0.0, gyroscope_drift=0.0, accelerometer_drift=0.0,
                         slipping=0.0)  # fmt: skip
    predict(quiet, readings, np.ones(len(belief.lost), bool), belief)
    after, found = element(belief, 0), np.zeros((SIZE, SIZE))
    for k in range(SIZE):
        plus, minus = (error_of(belief, 1 + 2 * k + s, after, 0.0, 0.0) for s in (0, 1))
        found[:, k] = (plus - minus) / (2.0 * small)
    np.testing.assert_allclose(belief.covariance[0], found @ found.T, atol=2e-4)
    # But for biases, the flow is that of the group, and exact.
    group = [k for k in range(SIZE) if not 9 <= k < 15]
    phi = transition(truth, spin, OWN.tick)
    np.testing.assert_allclose(found[:, group], phi[:, group], atol=1e-7)
    np.testing.assert_allclose(found, phi, atol=1e-4)


KINDS = {
    "invariant": (update, np.array([0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4, *[5] * 9])),
    "linear": (update_linear, np.array([0, 3, 1, 2, *[5] * FEET])),
}
"""Filter -> its step, and which of SPREAD the rows of its covariance have."""
SPREAD = np.array([0.02, 0.1, 1e-3, 0.02, 0.2, 2e-3])


class World:
    """Robots that move as the filter assumes, and what their sensors read."""

    def __init__(self, count, rng, start=0.0, kind="invariant"):
        self.rng, self.count = rng, count
        self.update, rows = KINDS[kind]
        self.truth = np.array([somewhere(rng) for _ in range(count)])
        self.truth[:, :3, 3] *= 0.3
        self.gyroscope, self.accelerometer = np.zeros((2, count, 3))
        self.belief = Belief.none(count, FEET, len(rows))
        self.readings = Readings.none(count, 3 * FEET, FEET)
        self.seen, self.all = state(count), np.ones(count, bool)
        self.time = 0.0
        spread = self.spread = start * SPREAD[KINDS["invariant"][1]]
        for i in range(count):
            xi = spread * rng.standard_normal(SIZE)
            believe(self.belief, i, exponential(xi) @ self.truth[i], xi[9:12], xi[12:15])
            self.belief.covariance[i] = np.diag((start * SPREAD[rows]) ** 2)

    def step(self, own, load=None):
        rng, dt, count = self.rng, own.tick, self.count
        self.time += dt
        phase = 2.0 * np.pi * self.time
        spin = np.stack([np.sin(phase), np.cos(1.3 * phase), 0.5 * np.sin(0.7 * phase)])
        push = np.stack([np.cos(1.7 * phase), np.sin(phase), np.cos(phase)])
        for i, x in enumerate(self.truth):
            middle = x[:3, :3] @ Rotation.from_rotvec(0.5 * dt * spin).as_matrix()
            change = dt * push
            x[:3, 4] += dt * (x[:3, 3] + 0.5 * change)
            x[:3, 3] += change
            x[:3, :3] = x[:3, :3] @ Rotation.from_rotvec(dt * spin).as_matrix()
            x[:3, 5:] += np.sqrt(own.slipping) * rng.standard_normal((3, FEET))
            force = middle.T @ (push + [0.0, 0.0, G])
            self.readings.gyroscope[i] = spin + self.gyroscope[i]
            self.readings.accelerometer[i] = force + self.accelerometer[i]
            seen = x[:3, :3].T @ (x[:3, 5:] - x[:3, 4:5])
            self.readings.angle[i] = seen.T.ravel()
        shape = count, 3
        self.readings.gyroscope[:] += np.sqrt(own.turning) / dt * rng.standard_normal(shape)
        self.readings.accelerometer[:] += np.sqrt(own.pushing) / dt * rng.standard_normal(shape)
        self.readings.angle[:] += np.sqrt(own.encoder) * rng.standard_normal((count, 3 * FEET))
        self.gyroscope += np.sqrt(own.gyroscope_drift) * rng.standard_normal(shape)
        self.accelerometer += np.sqrt(own.accelerometer_drift) * rng.standard_normal(shape)
        self.readings.load[:] = 10.0 if load is None else load
        self.readings.fresh[:] = True
        self.filter(own)

    def filter(self, own):
        self.update(own, LEGS, self.readings, self.all, self.belief, self.seen)


def test_a_dense_filter_in_numpy_agrees(rng):
    """Dense matrices, exponentials of the group, one update of all feet: as in the paper."""
    world = World(1, rng, start=1.0)
    mean, covariance = element(world.belief, 0), world.belief.covariance[0].copy()
    bias = [world.belief.gyroscope_bias[0].copy(), world.belief.accelerometer_bias[0].copy()]
    h = np.zeros((3 * FEET, SIZE))
    for foot in range(FEET):
        rows = slice(3 * foot, 3 * foot + 3)
        h[rows, 6:9], h[rows, 15 + 3 * foot : 18 + 3 * foot] = np.eye(3), -np.eye(3)
    dt = OWN.tick
    for _ in range(150):
        world.step(OWN)
        spin = world.readings.gyroscope[0] - bias[0]
        force = world.readings.accelerometer[0] - bias[1]
        middle = mean[:3, :3] @ Rotation.from_rotvec(0.5 * dt * spin).as_matrix()
        phi = transition(mean, spin, dt)
        noise = np.zeros((SIZE, SIZE))
        entry = np.concatenate(
            [np.eye(3), skew(mean[:3, 3]), skew(mean[:3, 4]), np.zeros((6, 3)),
             *(skew(d) for d in mean[:3, 5:].T)]
        )  # fmt: skip
        noise += OWN.turning * entry @ entry.T
        velocity = OWN.pushing * np.array([[1.0, dt / 2.0], [dt / 2.0, dt * dt / 3.0]])
        noise[3:9, 3:9] += np.kron(velocity, np.eye(3))
        noise[9:12, 9:12] += OWN.gyroscope_drift * np.eye(3)
        noise[12:15, 12:15] += OWN.accelerometer_drift * np.eye(3)
        noise[15:, 15:] += OWN.slipping * np.eye(3 * FEET)
        covariance = phi @ covariance @ phi.T + noise
        push = middle @ force - [0.0, 0.0, G]
        mean[:3, 4] += dt * (mean[:3, 3] + 0.5 * dt * push)
        mean[:3, 3] += dt * push
        mean[:3, :3] = mean[:3, :3] @ Rotation.from_rotvec(dt * spin).as_matrix()
        seen = world.readings.angle[0].reshape(FEET, 3)
        z = (seen @ mean[:3, :3].T - (mean[:3, 5:] - mean[:3, 4:5]).T).ravel()
        s = h @ covariance @ h.T + OWN.encoder * np.eye(3 * FEET)
        gain = covariance @ h.T @ np.linalg.inv(s)
        xi = gain @ z
        mean = exponential(-xi) @ mean
        bias = [bias[0] - xi[9:12], bias[1] - xi[12:15]]
        covariance = covariance - gain @ h @ covariance
    np.testing.assert_allclose(element(world.belief, 0), mean, atol=2e-5)
    np.testing.assert_allclose(world.belief.gyroscope_bias[0], bias[0], atol=2e-5)
    np.testing.assert_allclose(world.belief.accelerometer_bias[0], bias[1], atol=2e-4)
    size = np.sqrt(np.diag(covariance))
    found = np.sqrt(np.diag(world.belief.covariance[0]))
    np.testing.assert_allclose(found, size, rtol=0.01)


def test_errors_are_as_large_as_the_filter_believes(rng):
    """Normalised errors of 60 robots within chi-square bounds, p = 0.001, as feet come and go."""
    count = 60
    world = World(count, rng, start=1.0)
    drawn = world.spread[9:15] * rng.standard_normal((count, 6))
    world.gyroscope, world.accelerometer = drawn[:, :3].copy(), drawn[:, 3:].copy()
    world.belief.gyroscope_bias[:], world.belief.accelerometer_bias[:] = 0.0, 0.0
    own = [*range(6), *range(9, 15)]  # rotation, velocity, biases
    low, high = (chi2.ppf(p, len(own) * count) / count for p in (0.0005, 0.9995))
    for tick in range(1, 301):
        load = np.full((count, FEET), 10.0)
        load[:, (tick // 40) % FEET] = 0.0  # one foot is in the air
        before = world.belief.standing.copy()
        world.step(OWN, load)
        # A foot that has come down stands where it is: its place was never told before.
        new = world.belief.standing & ~before
        assert new.any() == (tick % 40 == 0 and tick > 39)
        if tick % 75 == 0:
            squares = []
            for i in range(count):
                truth = world.truth[i], world.gyroscope[i], world.accelerometer[i]
                error = error_of(world.belief, i, *truth)[own]
                part = world.belief.covariance[i][np.ix_(own, own)]
                squares.append(error @ np.linalg.solve(part, error))
            assert low < np.mean(squares) < high, (tick, low, np.mean(squares), high)


def test_heading_and_place_do_not_matter(rng):
    turn, shift = Rotation.from_euler("z", 1.1).as_matrix(), np.array([5.0, -3.0, 0.4])
    found = []
    for moved in (False, True):
        world, whole = World(1, np.random.default_rng(3), start=1.0), np.eye(5 + FEET)
        if moved:
            whole[:3, :3], whole[:3, 4:] = turn, shift[:, None]
        world.truth[0] = whole @ world.truth[0]
        # The same error, and the same doubt, seen in the moved world: by its adjoint.
        adjoint = np.zeros((SIZE, SIZE))
        adjoint[9:15, 9:15] = np.eye(6)
        for row, column in ((0, 3), (3, 3), (6, 4), *((15 + 3 * k, 5 + k) for k in range(FEET))):
            adjoint[row : row + 3, row : row + 3] = whole[:3, :3]
            if row:
                adjoint[row : row + 3, :3] = skew(whole[:3, column]) @ whole[:3, :3]
        xi = adjoint @ (world.spread * np.random.default_rng(4).standard_normal(SIZE))
        believe(world.belief, 0, exponential(xi) @ world.truth[0], xi[9:12], xi[12:15])
        world.belief.covariance[0] = adjoint @ np.diag(world.spread**2) @ adjoint.T
        world.rng = np.random.default_rng(5)
        slides = OWN._replace(slipping=0.0)
        for _ in range(60):
            step_in_own_axes(world, slides)
        found.append(np.linalg.inv(whole) @ element(world.belief, 0))
    np.testing.assert_allclose(found[0], found[1], atol=1e-7)


def step_in_own_axes(world, own):
    """A step in which the unit reads the same whatever the heading; the truth stays put."""
    rng = world.rng
    x = world.truth[0]
    world.readings.gyroscope[0] = 0.01 * rng.standard_normal(3)
    world.readings.accelerometer[0] = x[:3, :3].T @ [0.0, 0.0, G] + 0.1 * rng.standard_normal(3)
    seen = x[:3, :3].T @ (x[:3, 5:] - x[:3, 4:5])
    world.readings.angle[0] = seen.T.ravel() + 1e-3 * rng.standard_normal(3 * FEET)
    world.readings.load[:], world.readings.fresh[:] = 10.0, True
    world.filter(own)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("feet", [1, FEET])
def test_feet_that_slip_are_refused(rng, feet, kind):
    world, own = World(2, rng, start=0.1, kind=kind), OWN._replace(gate=16.27)
    for _ in range(50):
        world.step(own)
    before = world.belief.refused.copy()
    world.truth[0, :3, 5 : 5 + feet] += 0.05
    world.step(own)
    assert world.belief.refused[0] - before[0] == feet
    assert world.belief.refused[1] == before[1]
    for _ in range(20):
        world.step(own)
    error = [np.linalg.norm(world.belief.velocity[i] - world.truth[i, :3, 3]) for i in (0, 1)]
    assert max(error) < 0.05


@pytest.mark.parametrize("kind", KINDS)
def test_a_lost_estimate_begins_anew_and_says_so(rng, kind):
    world = World(3, rng, start=0.1, kind=kind)
    for _ in range(20):
        world.step(OWN)
    world.belief.velocity[0], world.belief.quaternion[1] = np.nan, np.nan
    world.belief.felt[:] = world.readings.accelerometer
    for _ in range(250):
        world.step(OWN)
    assert world.belief.restarts.tolist() == [1, 1, 0]
    assert np.isfinite(world.seen.qpos).all() and np.isfinite(world.belief.covariance).all()
    for i in range(3):
        own = Rotation.from_quat(np.roll(world.belief.quaternion[i], -1)).as_matrix()
        speed = own.T @ world.belief.velocity[i]
        assert np.linalg.norm(speed - world.truth[i, :3, :3].T @ world.truth[i, :3, 3]) < 0.3
