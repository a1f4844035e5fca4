"""What a robot is asked to do: initial state, commands, disturbances, observation, reward."""

from fbid_gym.tasks.balance import Balance
from fbid_gym.tasks.pushes import Pushes

__all__ = ["Balance", "Pushes"]
