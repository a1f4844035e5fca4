"""Train a policy with CrossQ through an action layer: `train.sac` without slow value networks.

python -m train.crossq --env fbid_gym/QuadrupedWalk-v0 --action-layer base_acceleration --seed 3
"""

import sys

from train.training import command_line

if __name__ == "__main__":
    sys.exit(command_line("crossq"))
