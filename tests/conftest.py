"""Fixtures and settings shared by all tests."""

import os
from collections.abc import Iterator

import numpy as np
import pytest

# Before anything imports mujoco: without a display, render off screen.
if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
    os.environ.setdefault("MUJOCO_GL", "egl")
from fbid_gym import robots


@pytest.fixture
def rng() -> np.random.Generator:
    """A seeded generator, fresh for every test."""
    return np.random.default_rng(20260101)


@pytest.fixture(scope="module", params=robots.ROBOTS)
def robot(request: pytest.FixtureRequest) -> robots.Robot:
    """Each built-in robot, where a module has no robots of its own."""
    return robots.load(request.param)


@pytest.fixture
def registries() -> Iterator[None]:
    """Layers, tasks, their terms and environments are as they were, afterwards."""
    import gymnasium

    from fbid_gym.actions import LAYERS
    from fbid_gym.tasks import TASKS

    kept = [(registry, dict(registry)) for registry in (LAYERS, TASKS, gymnasium.registry)]
    yield
    for registry, before in kept:
        registry.clear()
        registry.update(before)
    for kind in TASKS.values():
        kind.own_terms.clear()
