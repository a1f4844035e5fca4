"""Puts `stand_in` on the path of the tests and of the programs they start."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
