"""An actor that sees what a robot can, beside a critic that sees the truth.

Observations for robots begin with the group "policy"; the group "critic" follows
(`fbid_gym.runtime.observer`). The critic learns faster from what is true, and is not needed on the
robot (Pinto et al. 2018, "Asymmetric actor critic for image-based robot learning", RSS).
"""

from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import MlpExtractor
from torch import nn

from train.runs.config import TrainConfig


class _Sides(nn.Module):
    """The hidden layers of actor and critic, each with inputs of its own."""

    def __init__(self, split: int, width: int, **layers: Any) -> None:
        super().__init__()
        self._split = split
        actor = MlpExtractor(split, **layers)
        critic = MlpExtractor(width - split, **layers)
        self.policy_net, self.value_net = actor.policy_net, critic.value_net
        self.latent_dim_pi, self.latent_dim_vf = actor.latent_dim_pi, critic.latent_dim_vf

    def forward(self, features: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Return what both make of observations (N, O)."""
        return self.forward_actor(features), self.forward_critic(features)

    def forward_actor(self, features: torch.Tensor) -> torch.Tensor:
        """Return what the actor makes of its part."""
        seen: torch.Tensor = self.policy_net(features[:, : self._split])
        return seen

    def forward_critic(self, features: torch.Tensor) -> torch.Tensor:
        """Return what the critic makes of its part."""
        seen: torch.Tensor = self.value_net(features[:, self._split :])
        return seen


class AsymmetricPolicy(ActorCriticPolicy):
    """For stable-baselines3: `policy_kwargs` has `split`, the number of entries for the actor."""

    def __init__(self, *args: Any, split: int, **kwargs: Any) -> None:
        """Build it as an `ActorCriticPolicy`."""
        self.split = split
        super().__init__(*args, **kwargs)

    def _build_mlp_extractor(self) -> None:
        self.mlp_extractor = _Sides(  # type: ignore[assignment]
            self.split,
            self.features_dim,
            net_arch=self.net_arch,
            activation_fn=self.activation_fn,
            device=self.device,
        )

    def _get_constructor_parameters(self) -> dict[str, Any]:
        return super()._get_constructor_parameters() | {"split": self.split}


def is_for_robots(config: TrainConfig) -> bool:
    """Return whether observations have a part for the critic alone."""
    return str(config.make_args().get("observation")).startswith("measured")
