"""A recurrent policy of sb3-contrib learns to walk blind over planks, and plays in gym.make_vec."""

import argparse

import gymnasium as gym
import numpy as np
from sb3_contrib import RecurrentPPO

import fbid_gym

ENV = "fbid_gym/QuadrupedTerrain-v0"
ARGUMENTS = {"terrain": "planks", "action_layer": "base_acceleration", "difficulty": 0.5}


def main(steps: int, num_envs: int) -> None:
    """Train for a number of steps of all robots together, then play the policy."""
    robots = fbid_gym.make_sb3(ENV, num_envs=num_envs, seed=0, **ARGUMENTS)
    model = RecurrentPPO(
        "MlpLstmPolicy",
        robots,
        n_steps=32,
        batch_size=16 * num_envs,
        n_epochs=4,
        policy_kwargs={"log_std_init": -1.5, "lstm_hidden_size": 64},
        verbose=1,
        device="cpu",
    )
    model.learn(steps)

    # In a Gymnasium vector environment: what the policy remembers goes from step to step, and
    # begins anew where an episode does.
    envs = gym.make_vec(ENV, num_envs=8, autoreset_mode="SAME_STEP", **ARGUMENTS)
    observation, _ = envs.reset(seed=1)
    memory, begins, earned = None, np.ones(8, bool), []
    for _ in range(100):
        action, memory = model.predict(observation, memory, begins, deterministic=True)
        observation, reward, fell, late, _ = envs.step(action)
        begins = fell | late
        earned.append(reward)
    print(f"mean reward of a step: {np.mean(earned):.3f}, at most 1")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=500_000)
    parser.add_argument("--num-envs", type=int, default=64)
    main(**vars(parser.parse_args()))
