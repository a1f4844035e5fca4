"""Random floating-base systems in contact."""

from tests.control.systems import contacts, make_system

__all__ = ["contacts", "make_system"]
