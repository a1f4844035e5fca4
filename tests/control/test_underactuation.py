"""Directions of the base beyond the contacts' reach, against the rank of J's base columns."""

import numpy as np

from fbid_gym.control import orthogonal_inverse_dynamics, underactuation


def test_counts_the_directions_that_contacts_miss(make_system, contacts):
    system = make_system(contacts)
    found = underactuation(system.jacobian)
    rank = np.linalg.matrix_rank(system.jacobian[:, :, :6], rtol=1e-3)
    np.testing.assert_array_equal(found, 6 - rank)
    np.testing.assert_array_equal(found, orthogonal_inverse_dynamics(*system.law).underactuation)


def test_a_robot_gone_wrong_reaches_nothing_and_harms_no_other(make_system):
    jacobian = make_system("two flat feet").jacobian
    expected = underactuation(jacobian)
    jacobian[1, 3, 2] = np.nan
    expected[1] = 6.0
    np.testing.assert_array_equal(underactuation(jacobian), expected)
