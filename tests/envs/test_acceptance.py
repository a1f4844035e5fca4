"""Without any policy, the base_acceleration layer keeps the biped on its feet."""

import numpy as np
import pytest

from tests.batches import begun


@pytest.mark.slow
def test_the_zero_action_survives_pushes_of_100_newtons_from_any_side():
    """5 s under pushes of 100 N for 150 ms, at least 95 of 100 episodes: of 60, three may fall."""
    given = {"num_threads": 2, "action_layer": "base_acceleration", "episode_seconds": 5.0}
    given |= {"push_force": (100.0, 100.0), "push_duration": 0.15}
    env = begun("fbid_gym:fbid_gym/BipedBalance-v0", 60, **given)
    fallen, pushes = np.zeros(60, bool), []
    for _ in range(250):
        *_, terminated, _, info = env.step(np.zeros(env.action_space.shape))
        fallen |= terminated
        pushes.append(info["push"])
    assert fallen.sum() <= 3
    sizes = np.linalg.norm(pushes, axis=2)
    np.testing.assert_allclose(sizes[sizes > 0], 100.0)
    # Everyone was pushed for at least once 150 ms, which is seven or eight policy steps.
    assert ((sizes > 0).sum(axis=0) >= 7).all()
