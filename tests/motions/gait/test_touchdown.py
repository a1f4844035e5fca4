"""What a foot does: it lifts by the clock and stands by contact."""

import numpy as np
import pytest

from fbid_gym.motions.gait.touchdown import REACH, STANCE, SWING, next_mode

SHARES = np.linspace(0.0, 1.0, 21)


def test_a_foot_lifts_only_when_it_may_and_at_the_beginning_of_its_swing():
    for share in SHARES:
        assert next_mode(STANCE, True, False, share) == STANCE
    lifted = [next_mode(STANCE, True, True, share) == SWING for share in SHARES]
    assert lifted[0] and not any(lifted[5:])


@pytest.mark.parametrize("lifts", [True, False])
def test_a_foot_that_meets_the_ground_early_stands(lifts):
    modes = [next_mode(SWING, True, lifts, share) for share in SHARES]
    # Not while it is still leaving the ground, but in the second half of its way.
    assert modes[0] == SWING and set(modes[11:]) == {STANCE}
    for share in SHARES[:-1]:
        assert next_mode(SWING, False, lifts, share) == SWING


def test_a_foot_that_finds_no_ground_reaches_until_it_does():
    assert next_mode(SWING, False, False, 1.0) == REACH
    assert next_mode(REACH, False, False, 1.0) == REACH
    assert next_mode(REACH, True, False, 1.0) == STANCE
    # When it is due to lift it swings again, ground or not.
    assert next_mode(REACH, False, True, 0.0) == SWING
