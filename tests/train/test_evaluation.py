import numpy as np
import stand_in

from train.evaluation import evaluate


def _hold(observation):
    """Push back towards the origin, too weakly for the strongest pushes."""
    return np.clip(np.stack([-observation[:, 0] - observation[:, 1]] * 2, axis=1), -1.0, 1.0)


def test_first_episode_of_every_robot_against_one_robot_at_a_time():
    count, returns, lengths = 12, [], []
    for i in range(count):
        env = stand_in.PointMasses(1, 0)
        env.seed(40 + i)
        observation, total, steps, done = env.reset(), 0.0, 0, False
        while not done:
            observation, reward, (done,), _ = env.step(_hold(observation))
            total, steps = total + float(reward[0]), steps + 1
        returns.append(total)
        lengths.append(steps)
    row = evaluate(_hold, stand_in.PointMassEpisodes(count), seed=40)
    assert row["episodes"] == count
    assert row["length_mean"] == np.mean(lengths)
    assert row["survival"] == np.mean([steps == stand_in.STEPS for steps in lengths])
    assert 0 < row["survival"] < 1
    quartiles = np.quantile(returns, (0.25, 0.75))
    np.testing.assert_allclose((row["return_q25"], row["return_q75"]), quartiles)
    expected = np.mean(returns), np.std(returns)
    np.testing.assert_allclose((row["return_mean"], row["return_std"]), expected)


def test_same_seed_same_result_whatever_happened_before():
    envs = stand_in.PointMassEpisodes(5)
    first = evaluate(_hold, envs, seed=8)
    for _ in range(7):
        envs.step(np.ones((5, 2)))
    np.testing.assert_equal(evaluate(_hold, envs, seed=8), first)
    assert evaluate(_hold, envs, seed=9) != first
