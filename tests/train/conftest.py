"""Puts `stand_in` on the path of the tests and of the programs they start; trains by it, once."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

import stand_in


@pytest.fixture(scope="session")
def straight(tmp_path_factory):
    """A run of 6 iterations, never interrupted."""
    return stand_in.train(tmp_path_factory.mktemp("straight") / "run")
