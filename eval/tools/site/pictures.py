"""Draw the site's pictures of robots, before it is built: `python -m eval.tools.site.pictures`.

A clip of each environment, of a policy that is shipped or of a zero action, and for each layer a
chart of what its zero action makes of a push. What is there already stays; `--anew` draws it again.
"""

import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import tyro

from eval.page.figures import Marks, Series, colours_of, panel, sheet
from eval.rollout import Player, filmed
from eval.tools.site.environments import EnvironmentClip
from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.envs.robot_env import RobotEnv
from fbid_gym.errors import FbidError
from fbid_gym.exit_status import exit_status
from fbid_gym.policy import Policy
from fbid_gym.robots import load
from train.runs.files import write

FOLDER = Path("build/docs")  # where they go; git does not see it

CAPTION = (
    "The zero action of {} on the biped, pushed with 0.2 times its weight for 0.15 s. Thin: the "
    "other layers. A curve ends where the robot falls."
)

_ROBOT, _SHARE = "biped", 0.2
_BEFORE, _AFTER = 1.0, 2.0  # s, shown before and after the push
_SECONDS, _FPS = 3.0, 17.0  # of a clip
_SEED = 3


class Response(NamedTuple):
    """Motion of a robot after a push; T policy steps, up to its fall."""

    time: list[float]  # (T,) s, since the push began
    shift: list[float]  # (T,) cm, horizontally, of the base over the feet
    torque: list[float]  # (T,) N·m, rms over the joints


def respond(layer: str) -> Response:
    """Push the robot on the zero action of a layer."""
    force = _SHARE * load(_ROBOT).weight
    env = RobotEnv(
        _ROBOT,
        action_layer=layer,
        push_force=(force, force),
        push_interval=(_AFTER, _AFTER),  # there is one, half way
        joint_noise=0.0,
        velocity_noise=0.0,
        episode_seconds=2.0 * _AFTER,
    )
    env.reset(seed=_SEED)
    seen, hz = Response([], [], []), env.metadata["render_fps"]
    still = np.zeros(len(env.batch.action_names))
    for step in range(round(2.0 * _AFTER * hz)):
        observation, _, fallen, _, info = env.step(still)
        if fallen:
            break
        time = (step + 1) / hz - _AFTER
        if time >= -_BEFORE:
            seen.time.append(time)
            seen.shift.append(100.0 * float(np.hypot(observation[1], observation[2])))
            seen.torque.append(float(info["torque_rms"]))
    return seen


def chart(layer: str, responses: dict[str, Response]) -> str:
    """Draw the response of one layer, and thin those of the others: an SVG file."""
    words = layer.replace("_", " ")
    own = responses[layer]
    others = [each for name, each in responses.items() if name != layer]

    def drawn(quantity: str, title: str, top: float) -> str:
        singles = [(each.time, np.minimum(getattr(each, quantity), top)) for each in others]
        value = np.minimum(getattr(own, quantity), top)
        line = Series(words, colours_of([words])[words], own.time, value, singles=singles)
        marks, span = Marks(upright=0.0), (-_BEFORE, _AFTER)
        return panel([line], title, "s", x_range=span, y_range=(0.0, top), marks=marks)

    return sheet(
        [
            drawn("shift", "base from its place over the feet (cm)", 15.0),
            drawn("torque", "rms torque (N·m)", 25.0),
        ]
    )


def film(scene: EnvironmentClip, seconds: float = _SECONDS) -> bytes:
    """Film a scene: an mp4 file."""
    policy = None if scene.shipped is None else Policy.load(scene.shipped.path)
    arguments = {**scene.env_args, "render_options": {}}
    return filmed(Player("", scene.env_id, arguments, policy), 0, seconds, "", _FPS).mp4()


def main(anew: bool = False, clips: bool = True) -> None:
    """Draw what the site shows.

    Args:
        anew: whether to draw again what is there.
        clips: whether to film; that takes most of the time.
    """
    charts = {layer: FOLDER / "layers" / f"{layer}.svg" for layer in LAYERS}
    if anew or not all(path.exists() for path in charts.values()):
        responses = {layer: respond(layer) for layer in LAYERS}
        for layer, path in charts.items():
            write(path, chart(layer, responses))
    for scene in map(EnvironmentClip.of, ENVIRONMENTS) if clips else ():
        path = FOLDER / "environments" / scene.file
        if anew or not path.exists():
            try:
                clip = film(scene)
            except FbidError as error:  # nothing to draw with: the site does without
                print(f"No clips. {error}", file=sys.stderr)
                return
            write(path, clip)


if __name__ == "__main__":
    sys.exit(exit_status(lambda: tyro.cli(main, prog="python -m eval.tools.site.pictures")))
