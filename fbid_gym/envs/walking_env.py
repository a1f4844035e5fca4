"""The environments whose task is to walk to commands, described."""

from fbid_gym.envs.robot_env import RobotEnv


class WalkingEnv(RobotEnv):
    """A robot walks as fast, and where, as it is told.

    ## Description
    A command says how fast to go ahead and to the left and how fast to turn, and changes every few
    seconds; one in ten is to stand. An online gait makes of clock, command and state, at every
    control tick, which feet stand, where those in the air go, and how the body moves; its numbers
    are derived from what is measured on the robot's model. As everywhere the action layer is
    exchangeable and everything else stays the same.

    | Id                         | Robot    | Joints | Feet | Points | Gait                        |
    | -------------------------- | -------- | ------ | ---- | ------ | --------------------------- |
    | `fbid_gym/QuadrupedWalk-v0` | go1     | 12     | 4    | 4      | trot                        |
    | `fbid_gym/BipedWalk-v0`    | biped    | 16     | 2    | 8      | walk                        |
    | `fbid_gym/HumanoidWalk-v0` | humanoid | 27     | 2    | 8      | walk                        |

    Any robot with four point feet or with two flat ones walks: `robot="quadruped"`, `robot="g1"`
    or one of the user's. All that is not said here is as in `BalanceEnv`.

    ## Action Space
    A `Box` of [-1, 1], float32. The zero action follows the gait as well as the layer can.

    | `action_layer`               | Size   | Action 1 adds                                        |
    | ---------------------------- | ------ | ---------------------------------------------------- |
    | `torque`                     | joints | the joint's torque limit to what holds the home      |
    |                              |        | stance; there is no gait in it                       |
    | `joint_position`             | joints | option `scale` (rad) to the target of a PD           |
    |                              |        | controller on the joints' motion in the gait         |
    | `joint_position_feedforward` | joints | the same, smoothly, with the motion's torque fed     |
    |                              |        | forward                                              |
    | `joint_acceleration`         | joints | option `scale` (rad/s^2) to the joint's acceleration |
    | `base_acceleration`          | 6      | to the acceleration of the body: centre of mass      |
    |                              |        | ahead, to the left; base up; then angular x, y, z in |
    |                              |        | the base's frame                                     |
    | `com_wrench`                 | 6      | to the wrench at the centre of mass: force ahead, to |
    |                              |        | the left, up, then the moment likewise               |

    In the last two the feet in the air are tasks of their own. After the entries of the layer come,
    with option `footholds` (theirs by default), two for each foot: by how much its next foothold
    lies farther ahead and to the left, 0.2 times the height of the centre of mass at action 1; and
    with option `step_rate` one that raises the gait's frequency, by 20 % at action 1.
    `env.unwrapped.action_names` names them all.

    Options are those of `BalanceEnv`; with other defaults on a gait, see docs/arguments.md.
    `reference="home"` holds the PD controller's targets at the home posture: no gait, the action is
    all there is.

    ## Observation Space
    A `Box` of float32, the same for every layer; n joints, F feet, P contact points.

    | Entries | Observation                                                       | Range |
    | ------- | ----------------------------------------------------------------- | ----- |
    | 1       | sine of the gait's cycle (1)                                      | 1     |
    | 1       | cosine of the gait's cycle (1)                                    | 1     |
    | 1       | commanded velocity ahead (m/s)                                    | 10    |
    | 1       | commanded velocity to the left (m/s)                              | 10    |
    | 1       | commanded yaw rate (rad/s)                                        | 10    |
    | 1       | velocity ahead short of the command (m/s)                         | 100   |
    | 1       | velocity to the left short of the command (m/s)                   | 100   |
    | 1       | yaw rate short of the command (rad/s)                             | 100   |
    | F       | planned to stand (1)                                              | 1     |
    | 1       | height of the base above the ground, from home (m)                | 10    |
    | 3       | up direction (base frame)                                         | 1     |
    | 3       | base velocity (m/s, heading)                                      | 100   |
    | 3       | base angular velocity (rad/s, base frame)                         | 100   |
    | n       | position from home (rad)                                          | 10    |
    | n       | velocity (rad/s)                                                  | 100   |
    | n       | last torque (share of its limit)                                  | 1     |
    | P       | normal force on point (share of the weight)                       | 100   |

    The heading is that of the base, the ground that under the feet that are planned to stand.

    ## Rewards
    The sum of six terms, each between 0 and its weight; the weights sum to 1. With
    `bell(x) = exp(-x^2)`, h the height of the centre of mass at home and g gravity:

    | Term       | Weight | Scale             | Formula                                            |
    | ---------- | ------ | ----------------- | -------------------------------------------------- |
    | `velocity` | 0.4    | 0.19 sqrt(g h)    | `bell(horizontal velocity error of the base /      |
    |            |        |                   | scale)`                                            |
    | `turning`  | 0.2    | 0.09 sqrt(g / h)  | `bell(yaw rate error of the base / scale)`         |
    | `clock`    | 0.15   | 0.2 sqrt(g h)     | `share of the feet on the ground or off it as      |
    |            |        |                   | planned * bell(slip / scale)`                      |
    | `upright`  | 0.1    | 0.2 rad           | `exp(-(1 - cos(tilt of the base)) /                |
    |            |        |                   | (1 - cos(scale)))`                                 |
    | `steady`   | 0.05   | 0.3               | `bell((roll and pitch rate / sqrt(g / h) +         |
    |            |        |                   | vertical speed / sqrt(g h)) / scale)`              |
    | `torque`   | 0.1    | 0.5 mean torque   | `bell(rms of the torques / scale)`                 |
    |            |        | limit             |                                                    |

    `reward_weights={"torque": 0.0, "velocity": 0.6}` and `reward_scales={"velocity": 0.1}` change
    weights and, in the units above, scales; what they do not name stays.

    ## Starting State
    As in `BalanceEnv`: shaken home stance, any heading. With it come the commands and the pushes of
    the whole episode. A command is uniform in its ranges and holds for a time uniform in
    `command_interval`.

    ## Episode End
    As in `BalanceEnv`: a fall, a divergence, or `episode_seconds`. Where gait and `lowered_range`
    have a robot lower than it stands at home, it lies as much lower: H is then that of the walk.

    ## Arguments
    Those of `BalanceEnv` without `height_range` and `height_interval`, and

    | Parameter          | Default         | Description                                           |
    | ------------------ | --------------- | ----------------------------------------------------- |
    | `forward_range`    | `(-0.35, 0.58)` | (least, most) commanded velocity ahead over sqrt(g h) |
    | `sideways_range`   | `(-0.23, 0.23)` | (least, most) commanded velocity to the left,         |
    |                    |                 | likewise                                              |
    | `turning_range`    | `(-0.13, 0.13)` | (least, most) commanded yaw rate over sqrt(g / h)     |
    | `command_interval` | `(2.0, 5.0)`    | (least, most) s from one command to the next          |
    | `lowered_range`    | `(0.0, 0.0)`    | how much lower than the gait, of h, in an episode     |
    | `gait`             | `None`          | Of a quadruped: `"trot"` by default, `"walk"`,        |
    |                    |                 | `"pace"`, `"bound"`, `"stand"`                        |
    | `height_scan`      | `False`         | Whether the ground is seen; see `TerrainEnv`          |

    What one learns from must be cheap: these ids differ from the defaults in

    | Parameter           | `QuadrupedWalk-v0` | `BipedWalk-v0`, `HumanoidWalk-v0` |
    | ------------------- | ------------------ | --------------------------------- |
    | `physics_hz`        | `250`              | `250`                             |
    | `control_hz`        | `250`              | `250`                             |
    | `friction_cone`     | `"pyramidal"`      | `"pyramidal"`                     |
    | `solver_iterations` | `20`               | `20`                              |
    | `solver_warm_start` | `False`            | `False`                           |
    | `episode_seconds`   | `20.0`             | `20.0`                            |
    | `forward_range`     |                    | `(-0.14, 0.14)`                   |
    | `sideways_range`    |                    | `(-0.05, 0.05)`                   |
    | `turning_range`     |                    | `(-0.12, 0.12)`                   |
    | `push_force`        |                    | `(0.0, 0.0)`                      |

    Pushes of `QuadrupedWalk-v0` are 0 to 0.4 of the weight.

    ## Info
    Beside `torque_rms`, `power`, `slip`, `push`, `push_velocity`, `torque`, `contact_force`,
    `termination` and the layer's diagnostics, as in `BalanceEnv`:

    | Key                                     | Meaning                                            |
    | --------------------------------------- | -------------------------------------------------- |
    | `reward_velocity`, `reward_turning`,    | The terms of the reward                            |
    | `reward_clock`, `reward_upright`,       |                                                    |
    | `reward_steady`, `reward_torque`        |                                                    |
    | `velocity_error`                        | m/s, of the base, horizontal                       |
    | `turning_error`                         | rad/s, of the yaw rate                             |
    | `speed`, `speed_command`                | m/s, horizontal                                    |
    | `height`, `height_command`,             | m, of the base above the contact points, that of   |
    | `height_error`                          | the gait, and the difference                       |
    | `distance`                              | m, horizontal way of the base in this episode      |
    | `cost_of_transport`                     | Energy of the joints, the integral of `power`,     |
    |                                         | over weight times `distance`, of this episode; a   |
    |                                         | way shorter than h counts as h                     |
    | `foothold_error`                        | m, mean horizontal distance of the feet from their |
    |                                         | planned footholds as they came down in this        |
    |                                         | episode; 0 before the first                        |
    | `clipped_footholds`                     | Control ticks of this episode, summed over the     |
    |                                         | feet, at which a foothold was out of reach and was |
    |                                         | moved into it                                      |

    ## Version History
    * v0: Initial version.
    """
