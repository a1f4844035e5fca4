"""Check whether a policy can act on a robot, and say in words why not."""

from collections.abc import Mapping

from fbid_gym.envs.registered import registered
from fbid_gym.errors import PolicyFileError
from fbid_gym.policy import Policy
from fbid_gym.robots import Robot, load
from fbid_gym.runtime.observer import BODY


def check_fits(policy: Policy, robot: Robot, observation_size: int, action_size: int) -> None:
    """Raise PolicyFileError, which says why, unless a policy can act on a robot.

    Sizes of observation and action are those of the policy's environment with that robot.
    """
    try:
        policy.check(observation_size=observation_size, action_size=action_size)
    except PolicyFileError as error:
        if reason := _misfit(policy, robot, observation_size, action_size):
            raise PolicyFileError(f"{policy.source}: {reason}") from error
        raise


def sees_the_body(policy: Policy) -> bool:
    """Return whether a policy sees body and feet alone, which mean the same on every robot."""
    return policy.env_args.get("observation") == BODY


def _misfit(policy: Policy, robot: Robot, observation_size: int, action_size: int) -> str:
    """Say what of a robot a policy does not fit; empty where it is not the robot."""
    named = policy.env_args.get("robot", registered(policy.env_id).kwargs.get("robot"))
    if isinstance(named, Mapping):  # of the user's own
        return ""
    its = load(str(named))
    if its.num_feet != robot.num_feet:
        return f"it acts on {its.num_feet} feet, and {robot.name} has {robot.num_feet}."
    more = robot.num_joints - its.num_joints
    joints = f"{its.num_joints} joints, and {robot.name} has {robot.num_joints}"
    if more and observation_size != policy.observation_size and not sees_the_body(policy):
        return f"it sees {joints}. Expected one that learnt with observation={BODY!r}."
    if more and action_size - policy.action_size == more:
        layer = policy.env_args.get("action_layer")
        return f"it moves {joints}. Expected a layer that moves the body, not {layer!r}."
    return ""
