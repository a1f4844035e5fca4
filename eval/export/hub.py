"""A policy as a folder of the Hugging Face Hub: a card, the policy, and an environment.

    README.md            card: what it is, what it does, how it is used
    policy.safetensors   the policy itself, `Policy.load`
    policy.onnx          the same as ONNX
    config.json          its environment and its card
    env.py               make_env(n_envs), as LeRobot's EnvHub calls it
    requirements.txt     what env.py needs
    robot.zip            of a robot that is not built in

Nothing is sent anywhere.
"""

import json
from pathlib import Path

import msgspec

import fbid_gym
from eval.export.onnx_model import INPUT, OUTPUT, metadata_of, to_onnx
from eval.page.docs import markdown_table
from fbid_gym.checks import check_choices
from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.policy import Policy
from fbid_gym.runtime import Controller
from fbid_gym.runtime.config import AROUND, plain
from train.runs.files import to_json, write
from train.runs.robots import is_built_in
from train.runs.versions import versions

_ENV = '''"""The environment of this policy, as LeRobot's EnvHub loads it."""

import json
import os
from pathlib import Path

import gymnasium as gym

import fbid_gym  # registers the environments
from fbid_gym.robots import Robot

ENV_ID = {env_id!r}
ARGUMENTS = json.loads({arguments!r})


def make_env(n_envs: int = 1, use_async_envs: bool = False, cfg=None, **arguments):
    """Make a `gymnasium.vector.VectorEnv`; asynchronous ones are stepped by threads.

    LeRobot may give a `cfg`: it says nothing that this environment could be told. Other arguments
    are those of the environment, and go before the policy's.
    """
    robot = Path(__file__).with_name("robot.zip")
    if robot.exists():
        arguments.setdefault("robot", Robot.load(robot))
    threads = min(n_envs, os.cpu_count() or 1) if use_async_envs else 1
    return gym.make_vec(
        ENV_ID, num_envs=n_envs, num_threads=threads, **{{**ARGUMENTS, **arguments}}
    )
'''

_CARD = """---
library_name: fbid_gym
pipeline_tag: robotics
tags:
- robotics
- reinforcement-learning
- {policy.algorithm}
- {robot.name}
---

# {title}

A policy for `{policy.env_id}` of fbid_gym: robot {robot.name}, action layer \
`{config.action_layer}`, {policy.trained_steps:,} steps of
{learner}. It takes {policy.observation_size} observations at {rates.policy} Hz and gives \
{policy.action_size} actions; the
action layer turns these into the torques of {robot.num_joints} joints at {rates.control} Hz.

## What it does
{metrics}

## How to run it
With fbid_gym installed, in its environment:

```python
from env import make_env
from fbid_gym.policy import Policy

envs, policy = make_env(n_envs=4), Policy.load("policy.safetensors")
observations, _ = envs.reset(seed=0)
for _ in range(500):
    observations, *_ = envs.step(policy(observations))
```

On a robot, from its sensors to its torques, without Gymnasium:

```python
from fbid_gym.runtime import Controller

controller = Controller.load("policy.safetensors"{given})
torques = controller.tick(sensors)  # {rates.control} times a second
```

As ONNX: `policy.onnx` takes `{INPUT} (N, {policy.observation_size}) float32` and gives \
`{OUTPUT} (N, {policy.action_size}) float32 in [-1, 1]`; its metadata names every entry, the
joints, the layer with its options, and the rates.

## Files
`config.json` has the meaning of every argument of the environment, and the versions that wrote
this. SHA-256 of the robot: `{robot.digest}`.
"""


def write_hub(folder: Path, policy: Policy, controller: Controller, name: str) -> list[Path]:
    """Write the folder of a policy, file by file; return the files.

    Raises:
        FbidError: an environment of the user's, which others do not have; or see `to_onnx`.
    """
    check_choices("environment", (policy.env_id,), ENVIRONMENTS)
    metadata = metadata_of(policy, controller, name)
    model, robot = to_onnx(policy, metadata), controller.robot
    own = not is_built_in(robot)
    arguments = {k: v for k, v in policy.env_args.items() if k not in AROUND}
    if own:
        arguments.pop("robot", None)
    folder.mkdir(parents=True, exist_ok=True)
    written: dict[str, str | bytes] = {
        "README.md": _card(policy, controller, name, own),
        "env.py": _ENV.format(env_id=policy.env_id, arguments=json.dumps(plain(arguments))),
        "requirements.txt": f"fbid_gym=={fbid_gym.__version__}\n",
        "config.json": to_json(
            {
                "env_id": policy.env_id,
                "env_args": arguments,
                "environment": controller.config.resolved(),
                "card": msgspec.to_builtins(policy.card),
                "versions": versions(),
            }
        ),
        "policy.onnx": model,
    }
    for file, content in written.items():
        write(folder / file, content)
    policy.save(folder / "policy.safetensors")
    files = [*written, "policy.safetensors"]
    if own:
        robot.save(folder / "robot.zip")
        files.append("robot.zip")
    return [folder / file for file in files]


def _card(policy: Policy, controller: Controller, name: str, own: bool) -> str:
    return _CARD.format(
        policy=policy,
        robot=controller.robot,
        config=controller.config,
        rates=controller.rates,
        learner=policy.algorithm.upper(),
        title=name,
        metrics=_metrics(policy),
        given=', robot="robot.zip"' if own else "",
        INPUT=INPUT,
        OUTPUT=OUTPUT,
    )


def _metrics(policy: Policy) -> str:
    card = policy.card
    if card is None:
        return "Not measured here: `fbid-gym eval policy.safetensors --episodes 100` does."
    rows = [
        (metric, f"{x.mean:.4g}", f"{x.low:.4g} to {x.high:.4g}", x.unit)
        for metric, x in card.metrics.items()
    ]
    table = markdown_table(("", "mean", "interval", "unit"), rows)
    played = (
        f"{card.episodes} episodes from seed {card.first_seed}, {card.confidence:.0%} intervals."
    )
    return f"{table}\n\n{played} Trained by `{card.command}`."
