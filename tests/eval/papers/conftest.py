"""Random systems in contact, as the tests of laws have them."""

from tests.control.systems import contacts, make_system

__all__ = ["contacts", "make_system"]
