"""Policies act through the layer that they learnt with: what that means for other settings."""

from collections.abc import Mapping
from typing import Any

from eval.play.controls import Control, Settings, checked
from eval.play.stage import NO_POLICY, Stage
from fbid_gym.errors import InvalidValueError
from fbid_gym.policy import Policy


def layer_of(policy: Policy) -> str:
    """Return the layer through which a policy acts."""
    return str(policy.env_args.get("action_layer", "joint_position"))


def brought(stage: Stage, settings: Settings, name: str, value: Any) -> Settings:
    """Return what else changes with a setting: with a policy its layer, with a layer the policy."""
    if name == "policy" and value in stage.policies:
        policy = stage.policies[value]
        options = policy.env_args.get("layer_options") or {}
        return {
            "layer": layer_of(policy),
            "contact_limits": options.get("contact_limits", "friction"),
        }
    if name == "layer":
        acting = stage.policies.get(settings["policy"])
        if acting is not None and layer_of(acting) != value:
            return {"policy": NO_POLICY}
    return {}


def resolved(stage: Stage, offered: Mapping[str, Control], given: Mapping[str, Any]) -> Settings:
    """Return all settings for those that are given, the others as they are at the start.

    Raises:
        FbidError: a setting that may not be, or a layer that is not that of the policy.
    """
    asked = {name: checked(offered, name, value) for name, value in given.items()}
    settings = {name: control.default for name, control in offered.items()}
    for name in ("policy", "layer"):  # as a viewer would, the policy first
        if name in asked:
            settings |= {name: asked[name]} | brought(stage, settings, name, asked[name])
    settings |= asked
    if settings["policy"] in stage.policies:
        its = layer_of(stage.policies[settings["policy"]])
        if its != settings["layer"]:
            expected = f"{its!r}, through which {settings['policy']} acts"
            raise InvalidValueError("layer", settings["layer"], expected)
    return settings
