"""The environments whose task is to follow a motion, described."""

from fbid_gym.envs.robot_env import RobotEnv


class TrackingEnv(RobotEnv):
    """A robot follows a reference motion: squats, steps or walks.

    ## Description
    A motion says at every control tick where the joints and the base shall be, how fast, with what
    acceleration, and which feet stand ([M10] section IV). The robot shall follow it. As everywhere
    the action layer is exchangeable and everything else stays the same.

    | Id                           | Robot     | Task    | Motion                                 |
    | ---------------------------- | --------- | ------- | -------------------------------------- |
    | `fbid_gym/BipedSquat-v0`     | biped     | `squat` | squat and bow on both feet, [M10] IV.B |
    | `fbid_gym/BipedStep-v0`      | biped     | `step`  | squat and step in place, [M10] IV.D    |
    | `fbid_gym/QuadrupedCrawl-v0` | quadruped | `crawl` | walk at a commanded speed, three feet  |
    |                              |           |         | on the ground, [M10] IV.E              |
    | `fbid_gym/QuadrupedRough-v0` | quadruped | `crawl` | the same over planks that the motion   |
    |                              |           |         | knows nothing of                       |

    All that is not said here is as in `BalanceEnv`.

    ## Action Space
    As in `BalanceEnv`, with the same options. "Home" is the reference here: the zero action follows
    the motion as well as the layer can. `joint_position` moves the target of its PD controller with
    the reference and damps the difference of the velocities. `joint_position_feedforward`,
    `joint_acceleration` and `base_acceleration` also take the reference's acceleration, and its
    planted feet to be in contact (`contacts="planned"`), while a lifted foot swings as its joints
    follow theirs.
    `torque` has no feedback: its zero action holds the home stance's torques.

    The default gains of `joint_position` are for standing. They are too soft to walk without a
    policy, where the weight shifts from foot to foot: `crawl` wants a `natural_frequency` of 8 Hz
    or more.

    ## Observation Space
    A `Box` of float32, the same for every layer; n joints, F feet.

    | Entries | Observation                                                       | Range |
    | ------- | ----------------------------------------------------------------- | ----- |
    | 1       | sine of the phase of the motion (1)                               | 1     |
    | 1       | cosine of the phase of the motion (1)                             | 1     |
    | 1       | commanded speed (m/s)                                             | 10    |
    | F       | planned to stand (1)                                              | 1     |
    | 3       | base of the reference from home (m, support frame)                | 10    |
    | n       | reference from home (rad)                                         | 10    |

    Then come all entries of `BalanceEnv` but its first, the commanded height.

    ## Rewards
    The sum of six terms, each between 0 and its weight; the weights sum to 1. With
    `bell(x) = exp(-x^2)`, H the robot's size (height of hips or centre of mass above the
    feet, the higher) and g gravity:

    | Term       | Weight | Scale             | Formula                                            |
    | ---------- | ------ | ----------------- | -------------------------------------------------- |
    | `joints`   | 0.3    | 0.1 rad           | `bell(rms of the joints' errors / scale)`          |
    | `base`     | 0.2    | 0.06 H            | `bell(distance of the base from its reference /    |
    |            |        |                   | scale)`                                            |
    | `upright`  | 0.15   | 0.2 rad           | `exp(-(1 - cos(angle)) / (1 - cos(scale)))`, the   |
    |            |        |                   | angle between the vertical as base and reference   |
    |            |        |                   | see it                                             |
    | `velocity` | 0.15   | 0.1 sqrt(g H)     | `bell(horizontal velocity error of the base /      |
    |            |        |                   | scale)`                                            |
    | `contact`  | 0.1    | 0.033 sqrt(g H)   | `share of the points that are on the ground or off |
    |            |        |                   | it as planned * bell(speed of those on the ground  |
    |            |        |                   | / scale)`                                          |
    | `torque`   | 0.1    | 0.3 mean torque   | `bell(rms of the torques / scale)`                 |
    |            |        | limit             |                                                    |

    `reward_weights` and `reward_scales` change them, as in `BalanceEnv`.

    ## Starting State
    Anywhere in the motion, all moments equally likely, in the posture and with the velocity that
    the motion has there, facing anywhere, shaken by `joint_noise` and `velocity_noise`. A motion
    that ends holds its last posture.

    ## Episode End
    As in `BalanceEnv`: a fall, a divergence, or `episode_seconds`.

    ## Arguments
    Those of `BalanceEnv` without `height_range` and `height_interval`, and

    | Parameter      | Task    | Default | Description                                        |
    | -------------- | ------- | ------- | -------------------------------------------------- |
    | `speed`        | `squat` | `1.0`   | How many times faster than the slow motion of      |
    |                |         |         | [M10] figure 4; figure 5 shows 5                   |
    | `depth`        | `squat` | `None`  | rad, of the squat at the knee; 1.4 on `biped`      |
    | `step_seconds` | `step`  | `None`  | s, period of the stepping: each foot steps once; 3 |
    | `lift_seconds` | `step`  | `None`  | s it takes a foot to rise, and to come down again; |
    |                |         |         | 0.25; 0 is the instant change of [M10]             |
    | `speed_range`  | `crawl` | `None`  | (least, most) m/s, commanded forward speed,        |
    |                |         |         | constant in an episode; (0, 0.08) on `quadruped`   |
    | `step_seconds` | `crawl` | `None`  | s, period of the walk: each foot steps once; 1.5   |
    | `swing_height` | `crawl` | `None`  | m, how high a swinging foot is lifted; 0.05        |

    By default `squat` and `crawl` have no pushes, and those of `step` are 0.02 to 0.15 of the
    weight. The ground of `fbid_gym/QuadrupedRough-v0` is `terrain="obstacles"`.

    ## Info
    Beside `torque_rms`, `power`, `slip`, `push`, `push_velocity`, `torque`, `contact_force`,
    `termination` and the layer's diagnostics, as in `BalanceEnv`:

    | Key                                     | Meaning                                            |
    | --------------------------------------- | -------------------------------------------------- |
    | `reward_joints`, `reward_base`,         | The terms of the reward                            |
    | `reward_upright`, `reward_velocity`,    |                                                    |
    | `reward_contact`, `reward_torque`       |                                                    |
    | `height`, `height_command`,             | m, of the base above the contact points, that of   |
    | `height_error`                          | the reference, and the difference                  |
    | `joint_error`                           | rad, rms over the joints                           |
    | `speed`, `speed_command`                | m/s, of the base along the feet's heading          |

    ## Version History
    * v0: Initial version.
    """
