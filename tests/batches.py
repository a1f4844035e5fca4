"""Batches of environments that have begun."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.runtime.config import EnvConfig


def started(arguments: Mapping[str, Any], count: int) -> EnvBatch:
    """So many robots at the start of an episode, each with its number for a seed."""
    batch = EnvBatch(EnvConfig.of(dict(arguments)), count)
    for env in range(count):
        batch.seed(env, np.random.default_rng(env))
    batch.reset(np.arange(count))
    return batch
