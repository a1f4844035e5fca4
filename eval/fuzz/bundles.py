"""Bundles with changed bits: none is accepted as anything but what it was."""

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from fbid_gym.errors import FbidError
from fbid_gym.policy import Policy

UNIT = "changed bits"


def cases() -> st.SearchStrategy[dict[str, Any]]:
    """Return the choice of a policy, and of the places of bits and of the end of its files."""
    return st.fixed_dictionaries(
        {
            "seed": st.integers(0, 2**31),
            "file": st.sampled_from(["policy.json", "policy.safetensors"]),
            "bits": st.lists(st.floats(0.0, 1.0, exclude_max=True), min_size=0, max_size=3),
            "kept": st.one_of(st.just(1.0), st.floats(0.0, 1.0)),
        }
    )


def amount(case: dict[str, Any]) -> int:
    """Return how many bits of a case change."""
    return len(case["bits"])


def faults(case: dict[str, Any]) -> Iterator[str]:
    """Yield what goes wrong in a case, one sentence each."""
    policy = _policy(np.random.default_rng(case["seed"]))
    with tempfile.TemporaryDirectory() as folder:
        policy.save(Path(folder, "policy"))
        file = Path(folder, "policy", case["file"])
        content = bytearray(file.read_bytes())
        for share in case["bits"]:
            place = int(share * 8 * len(content))
            content[place // 8] ^= 1 << place % 8
        file.write_bytes(content[: round(case["kept"] * len(content))])
        try:
            found = Policy.load(Path(folder, "policy"))
        except FbidError as error:
            if "\n" in str(error).strip():
                yield "refused in more than one line"
            return
    # Another layout of the same JSON is the same policy.
    same = all(
        np.array_equal(a, b)
        for a, b in zip(
            (found.mean, found.variance, *found.weights, *found.biases),
            (policy.mean, policy.variance, *policy.weights, *policy.biases),
            strict=True,
        )
    )
    plain = ("env_id", "env_args", "activation", "clip", "trained_steps", "versions")
    if not same or any(getattr(found, name) != getattr(policy, name) for name in plain):
        yield "a changed policy was accepted"


def _policy(rng: np.random.Generator) -> Policy:
    widths = (5, 4, 3)
    return Policy(
        env_id="fbid_gym/BipedBalance-v0",
        env_args={"action_layer": "torque", "push_force": [20.0, 100.0]},
        mean=rng.normal(size=widths[0]),
        variance=rng.uniform(0.1, 4.0, size=widths[0]),
        weights=tuple(rng.normal(size=(b, a)) for a, b in zip(widths, widths[1:], strict=False)),
        biases=tuple(rng.normal(size=b) for b in widths[1:]),
        activation="tanh",
        clip=2.0,
        trained_steps=123,
        versions={"numpy": "2"},
    )
