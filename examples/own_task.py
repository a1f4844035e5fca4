"""Your own task: bob up and down at a pace that chance decides."""

import argparse
from dataclasses import dataclass
from typing import NamedTuple

import gymnasium as gym
import numpy as np

from fbid_gym.motions import home_target, in_world
from fbid_gym.quantities import Target
from fbid_gym.tasks import Group, Outcome, PlannedEpisode, Term, bell, register_task


class Bobbing(NamedTuple):
    """What is measured of N robots: observation, reward and metrics are made of it."""

    outcome: Outcome
    height: np.ndarray  # (N,) m, commanded
    error: np.ndarray  # (N,) m


@dataclass(frozen=True, eq=False, kw_only=True)
class Bob(PlannedEpisode):
    """Follow a sine of the base's height; see `fbid_gym.tasks.Task` for what each part is."""

    depth: float
    home: Target
    reward_terms = {
        "height": Term(lambda measured, width: bell(measured.error, width), 0.8, 0.03, "m"),
        "upright": Term(lambda measured: measured.outcome.posture.upright, 0.2),
    }

    @property
    def observation_groups(self):
        height = Group(("height (m)",), 10.0, lambda measured: measured.height[:, None])
        return {"height": height, **self.body.groups}

    def draw(self, rng):
        return self.begin_at_home(rng) | {"pace": np.array(rng.uniform(0.3, 0.8))}

    def target(self, plan, now):  # what the action layers follow
        return in_world(self.body.stance.heading, self.home, now.terms())

    def measure(self, outcome, plan, memory):
        bow = 0.5 - 0.5 * np.cos(2 * np.pi * plan["pace"] * outcome.state.tick / self.hz)
        height = self.body.height(1 - self.depth * bow)
        return Bobbing(outcome, height, outcome.posture.base[:, 2] - height)

    def metrics(self, measured):
        return {"height_error": measured.error}


def bob(episode, *, depth=0.1):
    """Build the task; its options are keyword-only arguments."""
    return Bob.from_episode(episode, depth=depth, home=home_target(episode.body.robot))


register_task("bob", bob)

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=500)
    envs = gym.make_vec("fbid_gym/BipedBalance-v0", num_envs=8, task="bob", depth=0.15)
    envs.reset(seed=0)
    for _ in range(parser.parse_args().steps):
        _, rewards, *_, info = envs.step(np.zeros(envs.action_space.shape))
    print(f"mean reward {rewards.mean():.2f}; heights off by {info['height_error'].round(3)} m")
