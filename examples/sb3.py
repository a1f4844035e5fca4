"""stable-baselines3: PPO learns through an action layer, on many robots side by side."""

import argparse

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

import fbid_gym


def main(steps: int, num_envs: int) -> None:
    """Train for a number of steps of all robots together, then see how the policy does."""
    robots = fbid_gym.make_sb3(
        "fbid_gym/QuadrupedWalk-v0", num_envs=num_envs, action_layer="joint_position", seed=0
    )
    robots = VecNormalize(robots, norm_reward=False)
    model = PPO(
        "MlpPolicy",
        robots,
        n_steps=48,
        batch_size=min(2048, 48 * num_envs),
        n_epochs=5,
        learning_rate=5e-4,
        policy_kwargs={"log_std_init": -1.5},  # the zero action walks: do not shake it off its feet
        verbose=1,
        device="cpu",
    )
    model.learn(steps)
    robots.training = False
    observation, earned = robots.reset(), []
    for _ in range(50):
        action, _ = model.predict(observation, deterministic=True)
        observation, reward, *_ = robots.step(action)
        earned.append(reward)
    print(f"mean reward of a step: {np.mean(earned):.3f}, at most 1")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--num-envs", type=int, default=256)
    main(**vars(parser.parse_args()))
