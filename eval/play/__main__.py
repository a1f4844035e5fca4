r"""Serve a page on which a robot walks or stands in real time, is pushed, and changes its layer.

python -m eval.play fbid_gym/QuadrupedWalk-v0 --beside joint_position
python -m eval.play --policy runs/my_run
"""

import logging
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import tyro

from eval.play import roster
from eval.play.controls import ALONE, controls
from eval.play.serving import close_server, measured, open_server, show
from eval.play.session import Session
from eval.play.stage import NO_POLICY, OWNED, Stage, check_stage
from eval.play.texts import from_words, words_of
from fbid_gym.checks import check_positive
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.errors import InvalidValueError
from fbid_gym.runtime.config import EnvConfig
from train.command import run_command
from train.environments import parse_env_args
from train.runs.robots import chosen

DEFAULT_ENV = "fbid_gym/QuadrupedWalk-v0"


@dataclass(frozen=True)
class PlayConfig:
    """Serve a page on which a robot moves in real time, is pushed, and changes its layer."""

    env: Annotated[str | None, tyro.conf.Positional] = None
    """Environment id. Default: that of the policy, or QuadrupedWalk-v0."""
    policy: tuple[Path, ...] = ()
    """Run folders, exported policies or `shipped:NAME`; the first acts first, all in its
    environment. They can be chosen on the page, beside all that are shipped for it and its robot.
    """
    action_layer: str | None = None
    """Layer to begin with. Default: the first policy's, or base_acceleration."""
    beside: str | None = None
    """Layer, or name of a policy, of a second robot under the same pushes and commands."""
    robot: str | None = None
    """Instead of the environment's or the policy's: a built-in robot, or your own: an MJCF, a URDF,
    a robot.toml or a robot.zip."""
    robots: tuple[str, ...] = ()
    """Other robots to choose from on the page, with as many feet: built-in ones, files, or drawn
    ones, "zoo:quadruped:0-15". Default: those built in, and eight drawn ones."""
    feet: tuple[str, ...] = ()
    """Of your own robot: names of bodies, sites or spheres, or '{"left": ["heel", "toe"]}'."""
    env_args: str = "{}"
    """Further environment arguments as a JSON object, instead of the policies'."""
    settings: str = ""
    """Settings as in the address of a link: "ahead=0.5&layer=com_wrench"."""
    host: str = "127.0.0.1"
    """Address to listen on. Anybody who reaches it can push the robot."""
    port: int = 8080
    """Port to listen on; 0 for any that is free."""
    measure: float | None = None
    """Run for so many s with one viewer, print what share of a core it takes, and stop."""


def stage_of(config: PlayConfig) -> Stage:
    """Decide where the session plays; FbidError if the command line does not fit together."""
    arguments = parse_env_args(config.env_args)
    for name in ("robot", *OWNED):
        if name in arguments and name not in ("layer_options", "terrain", "difficulty", "gait"):
            expected = "an argument that is not the page's own; see --help"
            raise InvalidValueError("--env-args", name, expected)
    given = roster.named(config.policy)
    env_id = config.env or next((entry.policy.env_id for entry in given), DEFAULT_ENV)
    policies = {entry.name: entry.policy for entry in given}
    check_stage(env_id, policies)
    robot = chosen(config.robot, config.feet) or roster.robot_of(given)
    if robot is not None:
        arguments["robot"] = robot
    if config.action_layer is not None or not given:
        arguments["action_layer"] = config.action_layer or "base_acceleration"
    stage = Stage.of(env_id, arguments, policies, given[0].name if given else NO_POLICY)
    for entry in given:
        if unlike := stage.unlike(entry.policy):
            expected = f"one that learnt where {given[0].name} did, or --env-args; it has {unlike}"
            raise InvalidValueError("--policy", str(entry.path), expected)
    own = robot or EnvConfig.of(ENVIRONMENTS[env_id]).load_robot()
    fitting = {
        entry.name: entry.policy
        for entry in roster.of_package(env_id, own)
        if not stage.unlike(entry.policy)
    }
    beside = roster.robots_beside(own, config.robots)
    return replace(stage, policies={**policies, **fitting}).among(beside)


def session_of(config: PlayConfig) -> Session:
    """Build the session."""
    stage = stage_of(config)
    words = words_of(config.settings)
    named = words.get("robot", stage.chosen)
    known = named if named in stage.robots else stage.chosen
    settings: dict[str, Any] = from_words(controls(stage.with_robot(known)), words)
    if config.action_layer is not None:
        settings["layer"] = config.action_layer
    if config.beside is not None:
        settings["beside"] = ALONE if config.beside == "" else config.beside
    return Session(stage, settings)


def run(config: PlayConfig) -> None:
    """Do what the command line asks, until it is interrupted."""
    if config.measure is not None:
        check_positive(measure=config.measure)
    session = session_of(config)
    server = open_server(session, config.host, config.port)
    try:
        if config.measure is not None:
            print(measured(server, session, config.measure))
            return
        from eval.play.page import Page

        page = Page(server, session)
        print(f"{show(server)}  (Ctrl-C ends it)", flush=True)
        page.run()
    except KeyboardInterrupt:
        print()
    finally:
        close_server(server)


def main(arguments: list[str] | None = None) -> int:
    """Command line."""
    logging.getLogger("websockets").setLevel(logging.ERROR)
    return run_command("eval.play", PlayConfig, run, arguments, __doc__)


if __name__ == "__main__":
    sys.exit(main())
