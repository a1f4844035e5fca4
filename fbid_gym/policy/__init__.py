"""Trained policies as data, and those that come with the package.

    from fbid_gym.policy import Policy, shipped

    for each in shipped():
        print(each.name, each.card.metrics["velocity_error"])
    policy = Policy.load("shipped:QuadrupedWalk-v0/base_acceleration")
    actions = policy(observations)          # (N, O) -> (N, A)

`python -m fbid_gym.policy` lists them.
"""

from fbid_gym.policy.card import Card, Measured, OnRobot
from fbid_gym.policy.policy import ACTIVATIONS, OUTPUTS, Policy
from fbid_gym.policy.policy_file import place_of
from fbid_gym.policy.shipping import Shipped, shipped

__all__ = [
    "ACTIVATIONS",
    "OUTPUTS",
    "Card",
    "Measured",
    "OnRobot",
    "Policy",
    "Shipped",
    "place_of",
    "shipped",
]
