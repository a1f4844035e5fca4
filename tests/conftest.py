"""Fixtures and settings shared by all tests."""

import os

import numpy as np
import pytest

# Before anything imports mujoco: without a display, render off screen.
if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
    os.environ.setdefault("MUJOCO_GL", "egl")


@pytest.fixture
def rng() -> np.random.Generator:
    """A seeded generator, fresh for every test."""
    return np.random.default_rng(20260101)
