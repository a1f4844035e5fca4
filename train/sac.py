"""Train a policy with SAC through an action layer: `train.ppo` with another algorithm.

    python -m train.sac --env fbid_gym/QuadrupedWalk-v0 --action-layer base_acceleration --seed 3

SAC learns from all that the robots did lately, not from the latest alone: it takes fewer steps of
the environment, and more time for each. Run folders are those of `train.ppo`, with the replay
buffer beside the checkpoint.
"""

import sys

from train.training import command_line

if __name__ == "__main__":
    sys.exit(command_line("sac"))
