"""Random systems in contact, as the tests of laws have them; and the biped."""

import pytest

from fbid_gym.robots import Robot, load
from tests.control.systems import contacts, make_system

__all__ = ["contacts", "make_system"]


@pytest.fixture(scope="module")
def robot() -> Robot:
    """The biped, where a module has no robots of its own."""
    return load("biped")
