"""Random differences of robots from their MJCF, and of the controller's model from both."""

from dataclasses import dataclass
from typing import Annotated

from fbid_gym.options import Number, Pair, check_fields

Share = Annotated[float, Number(0.0, 0.99)]
Offset = Annotated[float, Number(0.0, 1.0, "m")]
Ahead = Annotated[tuple[float, float], Pair(-1.0, 1.0, "m")]
Factor = Annotated[tuple[float, float], Pair(0.001, 1000.0)]
Load = Annotated[tuple[float, float], Pair(0.0, 10.0)]
Delay = Annotated[tuple[float, float], Pair(0.0, 1.0, "s")]  # every action on its way is remembered


@dataclass(frozen=True)
class Randomisation:
    """Ranges of the random differences, drawn anew for each robot and episode; all off by default.

    The plant is the simulated robot; the model is what model-based layers compute with. The model
    starts from the robot's MJCF and sees nothing of how the plant differs, nor does the policy;
    noise is that of `sensors`. Nor does anybody see how strong the motors are: torques that are
    observed, rewarded and reported are those commanded.
    """

    mass: Share = 0.0
    """Plant: each body's mass and inertia are scaled by 1 ± up to this share."""
    com: Offset = 0.0
    """Plant: each body's centre of mass is moved by up to this (m) along each axis."""
    friction: Factor = (1.0, 1.0)
    """Plant: (least, most) factor on the friction of the contacts."""
    contact_time: Factor = (1.0, 1.0)
    """Plant: (least, most) factor on the time constant of the contacts, the first number of their
    `solref`: below 1 they are harder. Physics make it two of their steps at least."""
    motor_strength: Factor = (1.0, 1.0)
    """Plant: (least, most) factor on the torque of each joint's motor."""
    action_delay: Delay = (0.0, 0.0)
    """Plant: (least, most) s from the choice of an action to its arrival at the action layer, in
    whole control ticks. Until the first one arrives there is the zero action."""
    loop_delay: Delay = (0.0, 0.0)
    """Plant: (least, most) s from the state that the action layer sees to the torque it makes of
    it. Layers know what their own `loop_delay` tells. See `fbid_gym.envs.loop_delay`."""
    motor_speed: Factor = (1.0, 1.0)
    """Plant: (least, most) factor on the speeds of the motors' torque-speed line, as of a battery
    that is full or empty. Laws believe in 1; ideal motors have no such line."""
    motor_lag: Factor = (1.0, 1.0)
    """Plant: (least, most) factor on the motors' lag."""
    payload: Load = (0.0, 0.0)
    """Plant: (least, most) mass that the base carries, as a share of the robot's. It is spread as
    the base's own; its centre lies up to a fifth of `Stance.radius` ahead or behind, and beside."""
    model_mass: Share = 0.0
    """Model: each body's mass and inertia are scaled by 1 ± up to this share."""
    model_com: Offset = 0.0
    """Model: each body's centre of mass is moved by up to this (m) along each axis."""
    total_mass: Factor = (1.0, 1.0)
    """Plant: (least, most) factor on the masses and inertias of all bodies alike."""
    model_total_mass: Factor = (1.0, 1.0)
    """Model: (least, most) factor on the masses and inertias of all bodies alike."""
    model_inertia: Factor = (1.0, 1.0)
    """Model: (least, most) factor on the rotational inertias of all bodies alike."""
    model_com_ahead: Ahead = (0.0, 0.0)
    """Model: (least, most) m by which the base's centre of mass lies farther ahead."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        check_fields(self, "randomisation {}")

    @property
    def any(self) -> bool:
        """Whether anything is random."""
        return self != Randomisation()
