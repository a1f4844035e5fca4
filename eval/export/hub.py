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
from eval.page.html import render
from fbid_gym.checks import check_choices
from fbid_gym.environments import ENVIRONMENTS
from fbid_gym.errors import RunError
from fbid_gym.policy import Policy
from fbid_gym.runtime import Controller
from fbid_gym.runtime.config import AROUND, plain
from train.runs.files import to_json, write
from train.runs.robots import is_built_in
from train.runs.versions import versions


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
        "README.md": render(
            "hub/README.md.jinja",
            **{"name": name, "policy": policy, "controller": controller, "robot": robot},
            **{"card": policy.card, "own": own, "INPUT": INPUT, "OUTPUT": OUTPUT},
        ),
        "env.py": render(
            "hub/env.py.jinja",
            env_id=repr(policy.env_id),
            arguments=repr(json.dumps(plain(arguments))),
        ),
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
    there = [file for file in written if (folder / file).exists()]
    if there and "policy.onnx" not in there:
        found = f"{folder}: holds {there[0]} but no policy.onnx, so no export wrote it"
        raise RunError(f"{found}. Expected a folder of an export, or a new one.")
    for file, content in written.items():
        write(folder / file, content)
    policy.save(folder / "policy.safetensors")
    files = [*written, "policy.safetensors"]
    if own:
        robot.save(folder / "robot.zip")
        files.append("robot.zip")
    return [folder / file for file in files]
