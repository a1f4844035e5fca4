r"""Write a policy in the forms that others run.

python -m eval.export shipped:QuadrupedWalk-v0/base_acceleration --onnx walk.onnx
python -m eval.export runs/my_run --hub my_policy
"""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from eval.export.hub import write_hub
from eval.export.onnx_model import metadata_of, to_onnx
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy.policy_file import PREFIX
from fbid_gym.runtime import Controller
from train.command import run_command
from train.environments import register
from train.runs.files import check_folder, check_output, write
from train.runs.reading import load
from train.runs.robots import chosen


@dataclass(frozen=True)
class ExportConfig:
    """Write a policy as an ONNX model, or as a folder for the Hugging Face Hub."""

    policy: Annotated[Path, tyro.conf.Positional]
    """Run folder, exported policy or `shipped:NAME`."""
    onnx: Path | None = None
    """The ONNX model: normalisation inside, joints, layer and rates in its metadata."""
    hub: Path | None = None
    """A folder with card, policy, ONNX model and an env.py. It is sent nowhere."""
    register: tuple[str, ...] = ()
    """Modules to import first, which register layers and tasks of yours."""
    robot: str | None = None
    """Of the policy: a built-in robot, an MJCF, a URDF, a robot.toml or a robot.zip."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""


def run(config: ExportConfig) -> None:
    """Write what was asked for."""
    if config.onnx is None and config.hub is None:
        raise InvalidValueError("export", "nothing", "--onnx FILE or --hub FOLDER, or both")
    check_output(config.onnx, "onnx", (".onnx",))
    if config.hub is not None:
        check_folder(config.hub, "hub")
    register(config.register)
    found = load(config.policy, chosen(config.robot, config.feet))
    policy, controller = found.policy, Controller.load(found.policy, found.robot)
    name = str(config.policy).removeprefix(PREFIX).removesuffix(".safetensors")
    if not str(config.policy).startswith(PREFIX):
        name = Path(name).name
    if config.onnx is not None:
        write(config.onnx, to_onnx(policy, metadata_of(policy, controller, name)))
        print(config.onnx)
    if config.hub is not None:
        for file in write_hub(config.hub, policy, controller, name):
            print(file)


if __name__ == "__main__":
    sys.exit(run_command("eval.export", ExportConfig, run))
