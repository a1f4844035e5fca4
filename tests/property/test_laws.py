"""What laws promise for any finite input.

- The answer is finite, whatever the finite input, and nothing raises.
- A robot's answer does not depend on the robots beside it, to the bit; one whose input is not
  finite has an answer that is not, and the others do not notice.
- Units do not matter: to the bit where they differ by powers of two in mass and time, which
  rounding does not see; else to `_TOLERANCE`, wherever it is clear which rows of J depend on each
  other. On rows that nearly do, a law must decide, and rounding may decide for it.
- Neither does the order of the contact points, nor that a point is named twice, to the same
  tolerance. Laws that share forces out among points are left out of the last: two points where one
  was are softer together, see the regularisation in `contact_forces`.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eval.papers.mistry2010 import force_feedback, metric
from fbid_gym import control
from fbid_gym.control import ContactLimits
from fbid_gym.dynamics.centroidal import centroidal_terms
from fbid_gym.quantities import ReducedContacts
from tests.property.problems import (
    DEPENDENCE,
    PER_ROBOT,
    Problem,
    Robots,
    Units,
    chosen,
    in_units,
    robots_of,
)

LIMITS = ContactLimits(0.6)
_Array = np.ndarray


def _equations(robots: Robots) -> force_feedback.Equation:
    moving = robots.terms.mass_matrix, robots.terms.bias
    return force_feedback.Equation(*moving, robots.jacobian, robots.acceleration, robots.drift)


def _limited(robots: Robots) -> Any:
    own = {"base_priority": robots.base_priority, "length": robots.length}
    return control.limited_inverse_dynamics(
        *_equations(robots), LIMITS, gravity=robots.gravity, **own
    )


def _weighted(robots: Robots) -> Any:
    cost = np.linspace(1.0, 5.0, robots.torque.shape[1])
    return control.orthogonal_inverse_dynamics(
        *_equations(robots), torque_cost=cost, base_priority=robots.base_priority
    )


def _metric(robots: Robots) -> Any:
    lengths = np.ones(6 + robots.torque.shape[1])  # a radian of a hinge counts as a length
    lengths[3:] = robots.length**2
    return metric.metric_inverse_dynamics(_equations(robots), np.diag(lengths))


def _task(robots: Robots) -> Any:
    desired = robots.task_jacobian, None, robots.task, robots.acceleration
    cost = np.r_[robots.base_priority, np.ones(robots.torque.shape[1])]
    return control.operational_space_acceleration(
        robots.jacobian, robots.drift, *desired, motion_cost=cost, least_gain=0.05 * robots.length
    )


def _shared(balancer: Callable[..., Any], torque_limit: float) -> Callable[[Robots], Any]:
    def law(robots: Robots) -> Any:
        count, rows = robots.drift.shape
        point_map = np.broadcast_to(np.eye(rows), (count, rows, rows)).copy()
        contacts = ReducedContacts(robots.jacobian, robots.drift, point_map)
        body = centroidal_terms(robots.terms, robots.velocity)
        posture = robots.acceleration[:, 6:].copy()
        arguments: dict[str, Any] = {
            "to_com": body.to_com,
            "point_map": point_map,
            "weight": np.abs(robots.gravity * body.mass),
            "length": robots.length,
        }
        torque_map = balancer(robots.terms, body, contacts, posture)
        if torque_limit < 0.0:
            return control.distribute_freely(torque_map, robots.wrench, **arguments)
        largest = torque_limit * np.abs(robots.torque).max(initial=0.0, axis=1, keepdims=True)
        bound = np.broadcast_to(largest, robots.torque.shape)
        return control.distribute(
            torque_map, robots.wrench, LIMITS, torque_limit=bound, **arguments
        )

    return law


LAWS: dict[str, Callable[[Robots], Any]] = {
    "orthogonal_inverse_dynamics": lambda robots: control.orthogonal_inverse_dynamics(
        *_equations(robots), base_priority=robots.base_priority
    ),
    "orthogonal_inverse_dynamics, torque_cost": _weighted,
    "metric_inverse_dynamics": _metric,
    "limited_inverse_dynamics": _limited,
    "operational_space_acceleration": _task,
    "distribute, garofalo2015": _shared(control.torque_map_garofalo2015, 1.0),
    "distribute, ott2011": _shared(control.torque_map_ott2011, 0.1),
    "distribute, inverse_dynamics": _shared(control.torque_map_inverse_dynamics, np.inf),
    "distribute_freely": _shared(control.torque_map_inverse_dynamics, -1.0),
    "inertia_weighted": lambda robots: force_feedback.inertia_weighted(_equations(robots)),
    "estimated_force": lambda robots: force_feedback.estimated_force(
        _equations(robots), robots.torque
    ),
}


_CLEAR = ("none", "repeated", "a row of zeros", "of rank two")
_TOLERANCE = 1e-5
"""Of the torques, and of what it takes to hold the robot."""
_COMPILED = [name for name in LAWS if "force" not in name and "weighted" not in name]
_EXACT_IN_ROWS = ["orthogonal_inverse_dynamics", "metric_inverse_dynamics", "estimated_force"]
_EXACT_IN_ROWS += ["operational_space_acceleration", "inertia_weighted"]


def problems(wild: bool) -> st.SearchStrategy[Problem]:
    """Return the choice of a problem: of the size of real robots, or of any."""
    most = 8.0 if wild else 0.0
    exponent = st.floats(-8.0, 8.0) if wild else st.floats(-1.5, 1.5)
    return st.builds(
        Problem,
        seed=st.integers(0, 2**31),
        robots=st.just(3),
        joints=st.integers(1, 20),
        points=st.integers(0, 8),
        dependence=st.sampled_from(DEPENDENCE),
        mass=exponent.map(lambda x: 10.0 * 10.0**x),
        length=exponent.map(lambda x: 0.5 * 10.0**x),
        effort=st.floats(-3.0, 1.0).map(lambda x: 10.0**x),
        stretch=st.tuples(*[st.floats(-most, most)] * 6),
    )


def _hold(name: str, problem: Problem) -> None:
    law, robots = LAWS[name], robots_of(problem)
    with np.errstate(all="ignore"):
        answer = law(robots)
        for field, value in answer._asdict().items():
            assert np.isfinite(value).all(), field
        _honesty(robots, answer)
        _company(law, robots, answer, problem.seed)
        rng = np.random.default_rng(problem.seed)
        fair, clear = not any(problem.stretch), problem.dependence in _CLEAR
        if name in _COMPILED and fair:
            _units(name, law, robots, answer, rng, exact=True)
        if fair and clear:
            _units(name, law, robots, answer, rng, exact=False)
            _rows(name, law, robots, answer, rng)


@pytest.mark.parametrize("law", LAWS)
@given(problem=problems(wild=False))
def test_laws_on_robots_of_any_fair_size(law: str, problem: Problem) -> None:
    _hold(law, problem)


@pytest.mark.parametrize("law", LAWS)
@given(problem=problems(wild=True))
def test_laws_on_numbers_that_no_robot_has(law: str, problem: Problem) -> None:
    """Every array by itself larger or smaller by up to eight orders of magnitude."""
    _hold(law, problem)


@pytest.mark.parametrize("length", [0.05, 5e-4, 5e-6])
def test_torque_limits_hold_on_short_levers(length):
    """Levers are short beside the longest, not beside a metre."""
    _hold("distribute, garofalo2015", Problem(0, 3, 3, 1, "none", 10.0, length, 10.0))


def _honesty(robots: Robots, answer: Any) -> None:
    """Whether an answer that breaks the equation of motion of the base says so."""
    if "residual" not in answer._fields or "acceleration" not in answer._fields:
        return
    mass_matrix, bias, jacobian, _, _ = _equations(robots)
    inertia = mass_matrix[:, :6] * answer.acceleration[:, None]
    contact = jacobian[:, :, :6].mT * answer.contact_force[:, None]
    summands = np.concatenate((inertia, bias[:, :6, None], -contact), axis=2)
    missing = np.abs(summands.sum(axis=2)) / np.abs(summands).sum(axis=2)
    unsaid = (missing.max(axis=1) > _TOLERANCE) & (answer.residual < _TOLERANCE)
    assert not unsaid.any(), "an answer that no robot can follow looks like any other"


def _company(law: Callable[[Robots], Any], robots: Robots, answer: Any, seed: int) -> None:
    """What robots do to each other."""
    lone = law(chosen(robots, slice(1, 2)))
    assert _same(lone, _rows_of(answer, slice(1, 2))), "alone another answer than among others"
    rng = np.random.default_rng(seed)
    field = PER_ROBOT[rng.integers(len(PER_ROBOT))]
    bad = (np.nan, np.inf)[rng.integers(2)]
    if field == "terms":
        inner = ("mass_matrix", "bias", "com", "world_from_base")[rng.integers(4)]
        terms = robots.terms
        spoilt = terms._replace(**{inner: _spoilt(getattr(terms, inner), bad, rng)})
        found = law(robots._replace(terms=spoilt))
    else:
        spoilt_field: dict[str, Any] = {field: _spoilt(getattr(robots, field), bad, rng)}
        found = law(robots._replace(**spoilt_field))
    others = np.array([0, 2])
    same = _same(_rows_of(found, others), _rows_of(answer, others))
    assert same, f"a robot whose {field} is not finite changes others' answers"


def _spoilt(values: np.ndarray, bad: float, rng: np.random.Generator) -> np.ndarray:
    """Values of robots, with one of the second's no number."""
    values = values.copy()
    if values[1].size:
        values[1].reshape(-1)[rng.integers(values[1].size)] = bad
    return values


def _units(
    name: str,
    law: Callable[[Robots], Any],
    robots: Robots,
    answer: Any,
    rng: np.random.Generator,
    exact: bool,
) -> None:
    powers = rng.integers(-20, 21, 2)
    if exact:
        units = Units(2.0 ** powers[0], 1.0, 2.0 ** powers[1])
    else:
        units = Units(*10.0 ** rng.uniform(-3.0, 3.0, 3))
    found = law(in_units(robots, units))[0]
    if name == "operational_space_acceleration":
        size = np.r_[np.full(3, units.length), np.ones(found.shape[1] - 3)]
        found = found / (size / units.time**2)
    else:
        found = found / units.moment
    if exact:
        np.testing.assert_array_equal(found, answer[0], "units that are powers of two matter")
    else:
        assert _distance(name, found, answer[0], robots) <= _TOLERANCE, f"{units} matter"


def _rows(
    name: str, law: Callable[[Robots], Any], robots: Robots, answer: Any, rng: np.random.Generator
) -> None:
    points = robots.drift.shape[1] // 3
    orders = {"their order": rng.permutation(points)}
    if name.partition(",")[0] in _EXACT_IN_ROWS:
        orders["naming them twice"] = np.tile(np.arange(points), 2)
    for what, order in orders.items():
        rows = (3 * order[:, None] + np.arange(3)).ravel()
        jacobian = np.ascontiguousarray(robots.jacobian[:, rows])
        found = law(robots._replace(jacobian=jacobian, drift=robots.drift[:, rows].copy()))
        apart = _distance(name, found[0], answer[0], robots)
        assert apart <= _TOLERANCE, f"{what} changes the answer"


def _distance(name: str, found: np.ndarray, answer: np.ndarray, robots: Robots) -> float:
    """Largest difference, as a share of the answer's size and of what holds the robot."""
    size = np.abs(answer).max(axis=1)
    if name == "operational_space_acceleration":
        size += robots.gravity / robots.length
    else:
        size += robots.gravity * robots.length * robots.terms.mass_matrix[:, 0, 0]
    return float((np.abs(found - answer).max(axis=1) / size).max())


def _rows_of(answer: Any, rows: slice | np.ndarray) -> tuple[np.ndarray, ...]:
    """What belongs to some of the robots."""
    return tuple(value[rows] for value in answer)


def _same(one: tuple[np.ndarray, ...], other: tuple[np.ndarray, ...]) -> bool:
    return all(np.array_equal(a, b, equal_nan=True) for a, b in zip(one, other, strict=True))
