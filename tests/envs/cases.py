"""Environments of every kind, for what is promised of all of them: seeds, batches, states."""

from fbid_gym.actions import LAYERS
from fbid_gym.envs import ENVIRONMENTS
from tests.batches import RANDOM, SHORT
from tests.pairs import pairs

BIPED, QUADRUPED, *_ = ENVIRONMENTS
WALK, TERRAIN = "fbid_gym/QuadrupedWalk-v0", "fbid_gym/QuadrupedTerrain-v0"
MEASURED, EXACT = {"contacts": "measured"}, {"contact_limits": "none"}
SCHEDULE = {"contacts": [(0.1, ["left", "right"]), (0.05, ["left"]), (0.02, [])]}
_DRIVES = {"base": "data_sheet", "lag": 0.004, "continuous_torque": 9.0, "thermal_time": 0.5}
_VARIED = {"loop_delay": (0.0, 0.007), "motor_speed": (0.7, 1.1), "motor_lag": (0.5, 2.0)}
MOTORS = {"motors": _DRIVES, "randomisation": _VARIED}
_NOISY = {"like": "mems", "contact_errors": 0.1, "imu_latency": (0, 0.01), "encoder_rate": 125}
SENSORS = {"sensors": _NOISY, "observation": "measured+estimate", "history": 2}
SENSORS |= {"randomisation": {"action_delay": (0.0, 0.02)}}

# Every environment, every layer; every way to assume contacts; with and without limits on forces;
# and what else changes the world or what is seen of it.
_GIVEN = [
    *((name, layer, {}) for name, layer in pairs(ENVIRONMENTS, LAYERS, 1)),
    *(
        (name, layer, {"layer_options": options})
        for name, layer, options in (
            (BIPED, "base_acceleration", MEASURED | EXACT),
            (BIPED, "base_acceleration", SCHEDULE | {"contact_ramp": 0.03}),
            (QUADRUPED, "base_acceleration", MEASURED),
            (BIPED, "joint_acceleration", MEASURED),
            (BIPED, "joint_position_feedforward", SCHEDULE | EXACT),
            (QUADRUPED, "joint_acceleration", EXACT),
        )
    ),
    (WALK, "base_acceleration", SENSORS),
    (WALK, "base_acceleration", MOTORS),
    (TERRAIN, "torque", {"curriculum": True}),
]
CASES = [
    (name, SHORT | {"action_layer": layer, "randomisation": RANDOM if i % 2 else None} | more)
    for i, (name, layer, more) in enumerate(_GIVEN)
]
"""Environment and arguments; every other one randomised."""
