"""Make environments, reset and step them: those that are named, or all."""

import sys

import gymnasium as gym

import fbid_gym

ours = [name for name in gym.registry if name.startswith("fbid_gym/")]
for name in sys.argv[1:] or ours:
    env = gym.make(name)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
    envs = gym.make_vec(name, num_envs=2, num_threads=2)
    envs.reset(seed=0)
    envs.step(envs.action_space.sample())
    envs.close()
assert len(ours) > 10, fbid_gym.__path__
