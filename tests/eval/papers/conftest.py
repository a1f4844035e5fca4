"""Random systems in contact, and random robots, as the tests of laws and of dynamics have them."""

from tests.control.systems import contacts, make_system
from tests.dynamics.models import (
    gymnasium_assets_fixture,
    integrate_fixture,
    random_mjcf_fixture,
    random_states_fixture,
    relative_error_fixture,
)

__all__ = [
    "contacts",
    "gymnasium_assets_fixture",
    "integrate_fixture",
    "make_system",
    "random_mjcf_fixture",
    "random_states_fixture",
    "relative_error_fixture",
]
