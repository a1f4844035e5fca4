import numpy as np
import stand_in

from train.evaluation import evaluate


def _hold(observation):
    """Push back towards the origin, too weakly for the strongest pushes."""
    return np.clip(np.stack([-observation[:, 0] - observation[:, 1]] * 2, axis=1), -1.0, 1.0)


def test_first_episode_of_every_robot_against_one_robot_at_a_time():
    count = 12
    together = evaluate(_hold, stand_in.PointMasses(count, 0), seed=40)
    for i in range(count):
        env = stand_in.PointMasses(1, 0)
        env.seed(40 + i)
        observation, total, steps, done = env.reset(), 0.0, 0, False
        while not done:
            observation, reward, (done,), (info,) = env.step(_hold(observation))
            total, steps = total + reward[0], steps + 1
        assert together.lengths[i] == steps
        assert together.survived[i] == info["TimeLimit.truncated"] == (steps == stand_in.STEPS)
        np.testing.assert_allclose(together.returns[i], total, rtol=1e-6)
    assert 0 < together.survived.sum() < count


def test_same_seed_same_result_whatever_happened_before():
    env = stand_in.PointMasses(5, 0)
    first = evaluate(_hold, env, seed=8)
    for _ in range(7):
        env.step(np.ones((5, 2)))
    again = evaluate(_hold, env, seed=8)
    np.testing.assert_array_equal(first.returns, again.returns)
    assert (evaluate(_hold, env, seed=9).returns != first.returns).any()


def test_summary():
    result = evaluate(_hold, stand_in.PointMasses(8, 0), seed=1)
    row = result.summary()
    assert row["episodes"] == 8
    assert row["return_mean"] == result.returns.mean()
    assert row["return_q25"] <= np.median(result.returns) <= row["return_q75"]
    assert row["survival"] == result.survived.mean()
