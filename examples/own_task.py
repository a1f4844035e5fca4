"""Your own task: bob up and down at a pace that chance decides."""

import argparse
from dataclasses import dataclass

import gymnasium as gym
import numpy as np

from fbid_gym.motions import home_reference
from fbid_gym.tasks import Body, Pushes, Start, register_task


@dataclass(frozen=True, eq=False)
class Bob:
    """Follow a sine of the base's height; see `fbid_gym.tasks.Task` for what each part is."""

    body: Body
    seconds: float
    hz: int
    pushes: Pushes
    start: Start
    depth: float
    derived = {}
    observation_names = property(lambda self: ("height (m)", *self.body.observation_names))
    observation_bound = property(lambda self: np.append(10.0, self.body.observation_bound))

    def draw(self, rng):
        robot, pushes = self.body.robot, self.pushes.draw(rng, self.seconds, self.hz)
        qpos, qvel = self.start.draw(robot, robot.home_qpos, np.zeros(robot.nv), rng)
        return {"qpos": qpos, "qvel": qvel, "pace": np.array(rng.uniform(0.3, 0.8)), **pushes}

    def memory(self, terms):
        return {}

    def reference(self, plan, now):
        return home_reference(self.body.robot)  # what the action layers follow

    def height(self, plan, outcome):
        bow = 0.5 - 0.5 * np.cos(2 * np.pi * plan["pace"] * outcome.state.tick / self.hz)
        return self.body.height(1 - self.depth * bow)

    def observe(self, outcome, plan, memory):
        return np.column_stack([self.height(plan, outcome), self.body.observe(outcome)])

    def reward(self, outcome, plan, memory):
        posture = outcome.posture
        error = posture.base[:, 2] - self.height(plan, outcome)
        terms = {"height": 0.8 * np.exp(-((error / 0.03) ** 2)), "upright": 0.2 * posture.upright}
        return terms, {"height_error": error}


register_task("bob", lambda *given, depth=0.1: Bob(Body.of(given[0]), *given[1:], depth))

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=500)
    envs = gym.make_vec("fbid_gym/BipedBalance-v0", num_envs=8, task="bob", depth=0.15)
    envs.reset(seed=0)
    for _ in range(parser.parse_args().steps):
        _, rewards, *_, info = envs.step(np.zeros(envs.action_space.shape))
    print(f"mean reward {rewards.mean():.2f}; heights off by {info['height_error'].round(3)} m")
