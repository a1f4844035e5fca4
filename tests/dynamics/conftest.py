"""The models and states on which the providers of dynamics are compared."""

from tests.dynamics.models import (
    gymnasium_assets_fixture,
    integrate_fixture,
    random_mjcf_fixture,
    random_states_fixture,
    relative_error_fixture,
)

__all__ = [
    "gymnasium_assets_fixture",
    "integrate_fixture",
    "random_mjcf_fixture",
    "random_states_fixture",
    "relative_error_fixture",
]
