"""Two providers, one set of terms; and a nominal model that differs exactly as asked."""

from dataclasses import replace

import numpy as np
import pytest

from fbid_gym import robots
from fbid_gym.dynamics import MuJoCoDynamics
from fbid_gym.dynamics.pinocchio_dynamics import PinocchioDynamics
from fbid_gym.errors import InvalidValueError, NonFiniteError, ShapeError, UnknownOptionError
from tests.dynamics.models import GYMNASIUM, random_states, relative_error, robot_called

EXACT = 1e-9


@pytest.fixture(scope="module", params=[*robots.ROBOTS, *GYMNASIUM, *range(12)])
def robot(request):
    return robot_called(request.param)


def assert_same_terms(actual, expected):
    assert actual._fields == expected._fields
    for name in expected._fields:
        ours, theirs = getattr(actual, name), getattr(expected, name)
        assert ours.shape == theirs.shape, name
        assert ours.flags.c_contiguous and ours.dtype == np.float64, name
        for row, reference in zip(ours, theirs, strict=True):
            assert relative_error(row, reference) < EXACT, name


def test_providers_agree(robot):
    """What MuJoCo's terms are held to, in the files beside this one, holds for both."""
    states = random_states(robot.model, 5)
    expected = MuJoCoDynamics(robot).terms(*states)
    actual = PinocchioDynamics(robot).terms(*states)
    assert_same_terms(actual, expected)


# --- a nominal model that is off on purpose ------------------------------------------------------


def edited(robot, scale, shift):
    """A robot with some bodies' inertials changed in its MJCF, as a user would write it."""
    spec = robot.spec.copy()
    for name, factor in scale.items():
        body = spec.body(name)
        body.mass *= factor
        body.inertia, body.fullinertia = factor * body.inertia, factor * body.fullinertia
    for name, offset in shift.items():
        spec.body(name).ipos = spec.body(name).ipos + offset
    return replace(robot, model=spec.compile())


@pytest.mark.parametrize("robot", [*robots.ROBOTS, 11, 12], indirect=True)
def test_nominal_model_is_the_edited_robot(robot):
    """Scaled and shifted bodies give what MuJoCo gives for an MJCF written that way."""
    names = [body.name for body in robot.spec.bodies if body.explicitinertial]
    scale = {names[-1]: 1.7, names[-3]: 0.6}
    shift = {names[-3]: (0.02, -0.03, 0.05), names[-2]: (0.0, 0.04, 0.0)}
    before = robot.model.body_mass.copy(), robot.model.body_ipos.copy()
    states = random_states(robot.model, 3)
    actual = PinocchioDynamics(robot, mass_scale=scale, com_offset=shift).terms(*states)
    expected = MuJoCoDynamics(edited(robot, scale, shift)).terms(*states)
    assert_same_terms(actual, expected)
    unchanged = MuJoCoDynamics(robot).terms(*states)
    assert relative_error(actual.mass_matrix, unchanged.mass_matrix) > 1e-4
    # The robot itself is left alone.
    np.testing.assert_array_equal(robot.model.body_mass, before[0])
    np.testing.assert_array_equal(robot.model.body_ipos, before[1])


def test_one_scale_for_all_bodies():
    robot = robots.load("biped")
    states = random_states(robot.model, 3)
    terms = PinocchioDynamics(robot).terms(*states)
    scaled = PinocchioDynamics(robot, mass_scale=1.2).terms(*states)
    armature = np.diag(robot.model.dof_armature)
    expected = 1.2 * (terms.mass_matrix - armature) + armature
    assert relative_error(scaled.mass_matrix, expected) < EXACT
    assert relative_error(scaled.bias, 1.2 * terms.bias) < EXACT
    assert relative_error(scaled.com, terms.com) < EXACT


# --- bad input -----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def biped():
    return robots.load("biped")


def test_bodies_scales_and_offsets_are_checked(biped):
    body = biped.model.body(biped.base_body).name
    for argument, value in (("mass_scale", 2.0), ("com_offset", (0, 0, 0))):
        message = f"Unknown body 'wing' in {argument}. Valid choices: .*{body}"
        with pytest.raises(UnknownOptionError, match=message):
            PinocchioDynamics(biped, **{argument: {"wing": value}})
    for value in (0.0, -1.0, np.nan, np.inf, "2.0", True, None):
        for given, name in ((value, ""), ({body: value}, rf"\['{body}'\]")):
            message = rf"Invalid mass_scale{name}: {value!r}\. Expected a positive number"
            with pytest.raises(InvalidValueError, match=message):
                PinocchioDynamics(biped, mass_scale=given)
    with pytest.raises(ShapeError, match=rf"com_offset\['{body}'\] has shape \(2,\). Expected \(3"):
        PinocchioDynamics(biped, com_offset={body: (0.0, 0.1)})
    for value in ((0.0, np.nan, 0.0), ("a", "b", "c")):
        with pytest.raises(InvalidValueError, match=rf"com_offset\['{body}'\]: .* Expected three"):
            PinocchioDynamics(biped, com_offset={body: value})


@pytest.mark.parametrize("kind", [MuJoCoDynamics, PinocchioDynamics])
def test_states_are_checked_and_answers_are_the_callers_own(biped, kind):
    dynamics = kind(biped)
    qpos, qvel = random_states(biped.model, 2)
    terms = dynamics.terms(qpos, qvel)
    kept = [array.copy() for array in terms]
    dynamics.terms(-qpos, 3 * qvel)
    for array, copy in zip(terms, kept, strict=True):
        np.testing.assert_array_equal(array, copy)
    for states, message in (
        ((qpos[:, :-1], qvel), rf"qpos has shape .*Expected \(N, {biped.nq}\)"),
        ((qpos[0], qvel[0]), "qpos has shape"),
        ((qpos, qvel[:1]), rf"qvel has shape .*Expected \(2, {biped.nv}\)"),
    ):
        with pytest.raises(ShapeError, match=message):
            dynamics.terms(*states)
    for k, name in enumerate(("qpos", "qvel")):
        bad = [qpos.copy(), qvel.copy()]
        bad[k][1, 8] = np.nan
        with pytest.raises(NonFiniteError, match=rf"{name} is not finite: .* index \(1, 8\)"):
            dynamics.terms(*bad)
    if kind is PinocchioDynamics:
        empty = dynamics.terms(qpos[:0], qvel[:0])
        assert [array.shape for array in empty] == [(0, *array.shape[1:]) for array in terms]
        # Quaternions need not be of unit length, but of some.
        qpos[:, 3:7] *= 5.0
        for array, copy in zip(dynamics.terms(qpos, qvel), kept, strict=True):
            np.testing.assert_allclose(array, copy, atol=1e-9)
        qpos[1, 3:7] = 0.0
        with pytest.raises(InvalidValueError, match=r"Invalid qpos\[1, 3:7\].* nonzero quatern"):
            dynamics.terms(qpos, qvel)
