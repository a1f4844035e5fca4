"""PPO in one file: Gymnasium's vector environment and torch, nothing in between."""

import argparse

import gymnasium as gym
import torch
from torch import nn

import fbid_gym  # noqa: F401  registers the environments


def network(inputs: int, outputs: int) -> nn.Sequential:
    """Two hidden layers and one that begins near zero: the policy begins with the zero action."""
    last = nn.Linear(128, outputs)
    nn.init.normal_(last.weight, std=0.01)
    return nn.Sequential(nn.Linear(inputs, 128), nn.ELU(), nn.Linear(128, 128), nn.ELU(), last)


def main(steps: int, num_envs: int, horizon: int = 32) -> None:
    """Train for a number of steps of all robots together."""
    envs = gym.make_vec("fbid_gym/BipedBalance-v0", num_envs, action_layer="base_acceleration")
    inputs, outputs = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
    actor, critic = network(inputs, outputs), network(inputs, 1)
    noise = nn.Parameter(torch.full((outputs,), -1.5))
    learnt = [*actor.parameters(), *critic.parameters(), noise]
    optimiser = torch.optim.Adam(learnt, 5e-4)
    seen, again = torch.as_tensor(envs.reset(seed=0)[0]), torch.zeros(num_envs, dtype=torch.bool)
    batch = num_envs * horizon
    for done in range(batch, steps + batch, batch):
        rows = []
        with torch.no_grad():
            for _ in range(horizon):
                wanted = torch.distributions.Normal(actor(seen), noise.exp())
                action = wanted.sample()
                after, reward, fell, late, _ = envs.step(action.clamp(-1, 1).numpy())
                now = seen, action, wanted.log_prob(action).sum(1), critic(seen)[:, 0], ~again
                again = torch.as_tensor(fell | late)  # the step after the end only resets
                rows.append((*now, torch.as_tensor(reward).float(), torch.as_tensor(fell), again))
                seen = torch.as_tensor(after)
            columns = [torch.stack(column) for column in zip(*rows, strict=True)]
            saw, did, was, value, real, reward, fell, ended = columns
            following, gain, gains = critic(seen)[:, 0], 0.0, torch.zeros_like(value)
            for t in reversed(range(horizon)):  # generalised advantages
                error = reward[t] + 0.99 * following * ~fell[t] - value[t]
                gains[t] = gain = error + 0.99 * 0.95 * gain * ~ended[t]
                following = value[t]
        saw, did, was, goal, gains = (x[real] for x in (saw, did, was, value + gains, gains))
        gains = (gains - gains.mean()) / (gains.std() + 1e-8)
        for part in (part for _ in range(5) for part in torch.randperm(len(saw)).chunk(4)):
            ratio = torch.distributions.Normal(actor(saw[part]), noise.exp()).log_prob(did[part])
            ratio = (ratio.sum(1) - was[part]).exp()
            better = torch.min(ratio * gains[part], ratio.clamp(0.8, 1.2) * gains[part]).mean()
            loss = (critic(saw[part])[:, 0] - goal[part]).square().mean() - better
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(learnt, 0.5)
            optimiser.step()
        print(f"{done:,} steps: mean reward {reward[real].mean():.3f}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--steps", type=int, default=500_000)
    parser.add_argument("--num-envs", type=int, default=64)
    main(**vars(parser.parse_args()))
