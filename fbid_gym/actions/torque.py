"""Layer `torque`: the action is the joint torque."""

from dataclasses import dataclass

import numpy as np

from fbid_gym.actions.joint_gains import holding_torque
from fbid_gym.actions.layer import GetTerms, Memoryless
from fbid_gym.motions.target import MotionKind
from fbid_gym.quantities import Memory, RobotState, Target
from fbid_gym.robots import Robot


@dataclass(frozen=True, eq=False)
class Torque(Memoryless):
    """tau = tau_home + action * torque limit. There is no feedback: targets are for the policy."""

    robot: Robot  # whose joints
    hold: np.ndarray  # (n,) N·m that keep the home stance in equilibrium, the zero action

    @classmethod
    def of(cls, robot: Robot, control_hz: int, kind: MotionKind) -> "Torque":
        """Build the layer. It has no options."""
        return cls(robot, holding_torque(robot))

    @property
    def action_names(self) -> tuple[str, ...]:
        """One torque a joint."""
        limits = zip(self.robot.joint_names, self.robot.torque_limit, strict=True)
        return tuple(f"torque of {joint} (x {limit:g} N·m)" for joint, limit in limits)

    def torque(
        self, action: np.ndarray, state: RobotState, target: Target, terms: GetTerms, memory: Memory
    ) -> np.ndarray:
        """See `ActionLayer.torque`."""
        return self.hold + action * self.robot.torque_limit
