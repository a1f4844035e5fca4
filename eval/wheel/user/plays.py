"""Play the policy of a folder for a second."""

import sys

import gymnasium as gym

import fbid_gym.policy

policy = fbid_gym.policy.Policy.load(sys.argv[1])
env = gym.make(policy.env_id, **policy.env_args)
observation, info = env.reset(seed=0)
for _ in range(50):
    observation, *outcome = env.step(policy(observation[None])[0])
    assert outcome[1] is False, "it fell"
assert not {"torch", "stable_baselines3"} & sys.modules.keys()
