"""Train a policy with PPO through an action layer.

    python -m train.ppo --env fbid_gym/BipedBalance-v0 --action-layer base_acceleration --seed 3

Started again with the same options it continues where it was, killed or not, and the numbers are
those of a training that was never interrupted.
"""

import sys

from train.training import command_line, main

__all__ = ["main"]

if __name__ == "__main__":
    sys.exit(command_line("ppo"))
