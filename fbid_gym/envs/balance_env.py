"""The Balance environments, described."""

from fbid_gym.envs.robot_env import RobotEnv


class BalanceEnv(RobotEnv):
    """A robot stands on its feet, follows a commanded height and takes pushes.

    ## Description
    A floating-base robot stands on all its feet. It shall keep its base above them, upright and at
    a commanded height, while random horizontal forces push the base. How a policy's action becomes
    joint torques is the choice of an *action layer*; everything else (robot, task, observation,
    reward, limits, seeds) is the same for all layers, so that what differs between two policies
    trained through two layers is the layer.

    | Id                             | Robot                           | Joints | Contact points |
    | ------------------------------ | ------------------------------- | ------ | -------------- |
    | `fbid_gym/BipedBalance-v0`     | two legs, flat feet, 55 kg      | 16     | 8              |
    | `fbid_gym/QuadrupedBalance-v0` | four legs, point feet, 2.7 kg   | 12     | 4              |
    | `fbid_gym/HumanoidBalance-v0`  | the whole body, flat feet, 77.5 kg | 27  | 8              |

    Physics runs at `physics_hz`, the action layer at `control_hz`, the policy at `policy_hz`.

    The *support frame* is the level frame of the feet: its origin is the mean of the contact
    points, z points up, and x is the heading for which the contact points, seen from above, lie
    nearest to where they are in the home stance. Nothing depends on where on the ground the robot
    stands or which way it faces.

    ## Action Space
    A `Box(-1, 1, (A,), float32)`, held for one policy step. In every layer the zero action means
    "hold the home posture as well as this layer can", and torques are cut off at the same limits.

    | `action_layer`               | A      | An action of 1 adds                                  |
    | ---------------------------- | ------ | ---------------------------------------------------- |
    | `torque`                     | joints | the joint's torque limit to the torque that holds    |
    |                              |        | the home stance                                      |
    | `joint_position`             | joints | option `scale` (rad) to the target of a PD           |
    |                              |        | controller                                           |
    | `joint_position_feedforward` | joints | the same, smoothly, to that of a softer one whose    |
    |                              |        | motion has its torque fed forward                    |
    | `joint_acceleration`         | joints | option `scale` (rad/s^2) to the joint's acceleration |
    |                              |        | back home                                            |
    | `base_acceleration`          | 6      | to the base's acceleration back home: x, y, z in the |
    |                              |        | support frame, then angular x, y, z in the base's    |
    |                              |        | frame                                                |
    | `com_wrench`                 | 6      | to the wrench a balancer asks of the contacts at the |
    |                              |        | centre of mass: force x, y, z, then moment x, y, z,  |
    |                              |        | in the support frame                                 |

    The last four are model-based. Three realise an acceleration by inverse dynamics of the floating
    base in contact ([M10] eq. 15), by default with contact forces limited to their friction cones.
    `com_wrench` asks of the contacts that the momentum changes as in [G15] eqs. 38, 39, through the
    same inverse dynamics or one of the papers' maps (`balancer`).

    `joint_position_feedforward` is [M10] eqs. 18-20: to that torque it adds PD feedback, by default
    as soft as the robot falls, and in the acceleration it returns the centre of mass to above the
    feet at `balance_frequency` (Hz; 0 for not at all). Its target follows the action at
    `target_frequency` (Hz), without overshoot.

    Action 1 of `base_acceleration` is what the stance allows: horizontally the acceleration that
    moves the centre of pressure to the nearer edge of the support, vertically half of gravity; for
    tilting the moment of the same shift and for turning that of friction, on the home inertia.

    `env.unwrapped.action_names` names each entry of the action with its scale and unit; of a vector
    environment it is `envs.unwrapped.action_names`.

    Options of the layers, whatever the task (`fbid_gym.actions.layer_options(name)` has the
    defaults). Frequencies are in Hz, or `Falling(1.7)` is 1.7 times that at which the robot
    falls over, sqrt(g / height of the centre of mass) / (2 pi):

    | Layer                        | Options                                                       |
    | ---------------------------- | ------------------------------------------------------------- |
    | `torque`                     | none                                                          |
    | `joint_position`             | `natural_frequency`, `damping_ratio`, `scale`, `reference`    |
    | `joint_position_feedforward` | `natural_frequency`, `damping_ratio`, `scale`,                |
    |                              | `target_frequency`, `balance_frequency`, and those about      |
    |                              | contacts                                                      |
    | `joint_acceleration`         | `natural_frequency`, `damping_ratio`, `scale`, and those      |
    |                              | about contacts                                                |
    | `base_acceleration`          | `balance_frequency`, `height_frequency`,                      |
    |                              | `rotation_frequency`, `posture_frequency`, `swing_frequency`, |
    |                              | `damping_ratio`, `moment_priority`, `velocity_gain`, and      |
    |                              | those about contacts                                          |
    | `com_wrench`                 | the same as `base_acceleration`, and `balancer`               |

    Every layer has `footholds` and `step_rate` beside, for a gait alone. What is `None` depends on
    the robot and on the kind of motion: see docs/arguments.md.

    What the model-based layers assume of contacts:

    | Option               | Default      | Meaning                                                |
    | -------------------- | ------------ | ------------------------------------------------------ |
    | `contacts`           | `"planned"`  | Which points are on the ground: of the feet that shall |
    |                      |              | stand; `"all"`; `"measured"`; or a schedule            |
    |                      |              | `[(seconds, feet), ...]`                               |
    | `contact_limits`     | `"friction"` | Limits of the contact forces; `"none"` is the paper's  |
    |                      |              | form                                                   |
    | `contact_ramp`       | `None`       | s that the torque takes to what a switch of contacts   |
    |                      |              | makes of it; at 0 it jumps                             |
    | `friction`           | `None`       | Coefficient of friction                                |
    | `min_normal_force`   | `0.0`        | Least normal force of a point, share of the weight     |
    | `max_normal_force`   | `inf`        | Greatest, likewise                                     |
    | `compensate_damping` | `True`       | Add the torque that the joints' viscous damping takes  |
    |                      |              | away; what springs take always is                      |
    | `compensate_friction` | `False`     | Add what dry friction takes while joints move          |

    ## Observation Space
    A `Box` of float32, the same for every layer. Values are clipped to the ranges below;
    `env.unwrapped.observation_names` names each entry, `env.unwrapped.batch.observation_columns`
    says where each group of them is ("command", "base", "up", ...). "From home" is the difference
    to the home stance. Slide joints have m where hinges have rad.

    | Biped | Quadruped | Humanoid | Observation                                         | Range |
    | ----- | --------- | -------- | --------------------------------------------------- | ----- |
    | 0     | 0         | 0        | commanded height - home height (m)                  | 10    |
    | 1-3   | 1-3       | 1-3      | base from home (m, support frame)                   | 10    |
    | 4-6   | 4-6       | 4-6      | up direction (base frame)                           | 1     |
    | 7-9   | 7-9       | 7-9      | base velocity (m/s, support frame)                  | 100   |
    | 10-12 | 10-12     | 10-12    | base angular velocity (rad/s, base frame)           | 100   |
    | 13-28 | 13-24     | 13-39    | joints: position from home (rad)                    | 10    |
    | 29-44 | 25-36     | 40-66    | joints: velocity (rad/s)                            | 100   |
    | 45-60 | 37-48     | 67-93    | joints: last torque (share of its limit)            | 1     |
    | 61-68 | 49-52     | 94-101   | points: normal force on point (share of the weight) | 100   |

    The last torque is that of the last control tick, the normal force that of the last physics
    step.

    ## Rewards
    The reward of a step is the sum of six terms, each between 0 and its weight; the weights sum to
    1, so a return is at most the number of steps. With `bell(x) = exp(-x^2)`, H the robot's size
    (height of hips or centre of mass above the feet, the higher) and g gravity:

    | Term        | Weight | Scale             | Formula                                           |
    | ----------- | ------ | ----------------- | ------------------------------------------------- |
    | `height`    | 0.25   | 0.03 H            | `bell((height - commanded height) / scale)`       |
    | `upright`   | 0.15   | 0.2 rad           | `exp(-(1 - cos(tilt of the base)) /               |
    |             |        |                   | (1 - cos(scale)))`                                |
    | `position`  | 0.15   | 0.06 H            | `bell(horizontal distance of the base from home / |
    |             |        |                   | scale)`                                           |
    | `stillness` | 0.15   | 0.16              | `bell(norm of the base's velocity in sqrt(g H)    |
    |             |        |                   | and rate of turning in sqrt(g / H) / scale)`      |
    | `contact`   | 0.15   | 0.033 sqrt(g H)   | `share of the points on the ground * bell(their   |
    |             |        |                   | speed / scale)`                                   |
    | `torque`    | 0.15   | 0.3 mean torque   | `bell(rms of the torques / scale)`                |
    |             |        | limit             |                                                   |

    `reward_weights={"torque": 0.0}` and `reward_scales={"height": 0.05}` change weights and, in the
    units above, scales; what they do not name stays. docs/own_task_and_layer.md adds terms.

    Height and distance count in the support frame. A point is on the ground while it carries more
    than 1 % of the weight; their speed is the mean. The rms is over the joints and the control
    ticks of the step, everything else is taken at its end. The last step of an episode that ends by
    a fall is rewarded as any other; that of a diverged robot gets 0.

    ## Starting State
    The home pose with a random heading; each joint is moved by up to `joint_noise` (and stays in
    its range), each entry of the velocity is up to `velocity_noise`, all uniformly distributed. The
    base is raised so that the lowest contact point touches the ground. With the state come the
    pushes and the commanded heights of the whole episode.

    A push is a horizontal force on the base's centre of mass, in a uniformly random direction, of a
    size uniform in `push_force`, constant for `push_duration`. As it begins, the base's velocity
    jumps the same way by as large a share of `push_velocity`. The time from one push to the next
    (and from the start to the first) is uniform in `push_interval`. The commanded height is
    constant for a time uniform in `height_interval`; each value is uniform in `height_range` times
    H.

    ## Episode End
    ### Termination
    1. *fall*: the base is lower than 0.6 H above the contact points, or tilted by more than 60
       degrees.
    2. *diverged*: the simulation became unstable (a velocity above 500 m/s or rad/s, or not
       finite). The last observation is that of the step before.

    ### Truncation
    After `episode_seconds`, inside the environment: no `TimeLimit` wrapper is needed.

    ## Arguments
    ```python
    import gymnasium as gym, fbid_gym
    env = gym.make("fbid_gym/BipedBalance-v0", action_layer="torque", push_force=(50, 150))
    ```

    | Parameter         | Type           | Default            | Description                        |
    | ----------------- | -------------- | ------------------ | ---------------------------------- |
    | `robot`           | str or `Robot` | `"biped"`          | Who stands; the ids above set it   |
    | `task`            | str            | `"balance"`        | What it does; likewise             |
    | `action_layer`    | str            | `"joint_position"` | See `Action Space`                 |
    | `layer_options`   | dict or None   | `None`             | Arguments of the action layer      |
    | `physics_hz`      | int            | `1000`             | Simulation steps per second        |
    | `control_hz`      | int            | `500`              | Control ticks per second; divides  |
    |                   |                |                    | `physics_hz`                       |
    | `policy_hz`       | int            | `50`               | Environment steps per second;      |
    |                   |                |                    | divides `control_hz`               |
    | `episode_seconds` | float          | `10.0`             | Longest episode                    |
    | `push_force`      | pair or None   | `None`             | (least, most) N of a push; by      |
    |                   |                |                    | default 0.04 to 0.36 of the        |
    |                   |                |                    | weight, (0, 0) for none            |
    | `push_velocity`   | pair           | `(0.0, 0.0)`       | (least, most) m/s by which a push  |
    |                   |                |                    | changes the base's velocity at     |
    |                   |                |                    | once                               |
    | `push_duration`   | float          | `0.15`             | s                                  |
    | `push_interval`   | pair           | `(1.5, 3.0)`       | (least, most) s                    |
    | `height_range`    | pair           | `(0.94, 1.0)`      | (least, most) commanded height     |
    |                   |                |                    | over H                             |
    | `height_interval` | pair           | `(2.0, 4.0)`       | (least, most) s                    |
    | `terrain`         | str            | `"flat"`           | The ground: also `"obstacles"`     |
    |                   |                |                    | (planks) or `"rocks"`. An episode  |
    |                   |                |                    | starts on a level place of it      |
    | `terrain_height`  | float or None  | `None`             | m, of obstacles' or rocks' highest |
    |                   |                |                    | point; 0.19 of the centre of       |
    |                   |                |                    | mass's                             |
    | `terrain_seed`    | int            | `0`                | Decides where everything lies      |
    | `difficulty`      | float          | `0.5`              | Of `"slopes"`, `"stairs"` and the  |
    |                   |                |                    | like, 0 to 1; see `TerrainEnv`     |
    | `curriculum`      | bool           | `False`            | Whether robots move between levels |
    |                   |                |                    | of difficulty; see `TerrainEnv`    |
    | `joint_noise`     | float          | `0.02`             | rad, see `Starting State`          |
    | `velocity_noise`  | float          | `0.05`             | m/s and rad/s, see there           |
    | `friction_cone`   | str            | `"elliptic"`       | Or `"pyramidal"`: cheaper, and a   |
    |                   |                |                    | little different by heading        |
    | `solver_iterations` | int or None  | `None`             | Most iterations of the physics'    |
    |                   |                |                    | contact solver; by default         |
    |                   |                |                    | MuJoCo's                           |
    | `solver_warm_start` | bool         | `True`             | Whether it begins at the last      |
    |                   |                |                    | step's accelerations               |
    | `reward_weights`  | dict or None   | `None`             | Weights of terms of the reward by  |
    |                   |                |                    | name, see `Rewards`                |
    | `reward_scales`   | dict or None   | `None`             | Widths of their bells by name      |
    | `randomisation`   | dict or None   | `None`             | Ranges of differences between      |
    |                   |                |                    | robots and in the layer's model:   |
    |                   |                |                    | `mass`, `com`, `friction`,         |
    |                   |                |                    | `motor_strength`, `action_delay`,  |
    |                   |                |                    | `model_mass`, `model_com`,         |
    |                   |                |                    | `total_mass`, `model_total_mass`,  |
    |                   |                |                    | `model_inertia`,                   |
    |                   |                |                    | `model_com_ahead`; see             |
    |                   |                |                    | `Randomisation`                    |
    | `render_mode`     | str or None    | `None`             | `"rgb_array"` or `"human"`; an     |
    |                   |                |                    | arrow is a push                    |
    | `render_options`  | dict or None   | `None`             | What is drawn over the robot, each |
    |                   |                |                    | True or False: `forces`, `cones`,  |
    |                   |                |                    | `com`, `capture_point`, `support`, |
    |                   |                |                    | `footholds`, `acceleration`        |

    The range of each, and of every option of layers and tasks: docs/arguments.md, or
    `python -m fbid_gym.envs`.

    ### Randomisation
    What `randomisation` names is drawn anew for each robot and episode, uniformly in its range:

    | Name             | Value         | Meaning                                                  |
    | ---------------- | ------------- | -------------------------------------------------------- |
    | `mass`           | share         | Each body's mass and inertia are scaled by 1 ± up to it  |
    | `com`            | m             | Each body's centre of mass is moved by up to it along    |
    |                  |               | each axis                                                |
    | `friction`       | (least, most) | Factor on the friction of the contacts                   |
    | `motor_strength` | (least, most) | Factor on each joint's torque; all that is seen,         |
    |                  |               | rewarded and reported of torques is what was commanded   |
    | `action_delay`   | (least, most) | s that an action takes to the action layer, in whole     |
    |                  |               | control ticks; before the first comes the zero action    |
    | `model_mass`     | share         | As `mass`, in the model that model-based layers compute  |
    |                  |               | with: it starts from the MJCF and sees none of the above |
    | `model_com`      | m             | As `com`, likewise                                       |
    | `total_mass`     | (least, most) | Factor on the masses and inertias of all bodies alike    |
    | `model_total_mass` | (least, most) | As `total_mass`, in that model                         |
    | `model_inertia`  | (least, most) | Factor on all rotational inertias in that model          |
    | `model_com_ahead` | (least, most) | m by which the base's centre of mass is ahead of where  |
    |                  |               | the MJCF has it, in that model                           |

    `gym.make_vec` adds `num_envs`, `num_threads` and `autoreset_mode`, see `RobotVectorEnv`;
    environment i of a batch with seed s is this environment with seed s + i, to the bit.

    Raises `FbidError` for an argument or an action that is not valid, naming the value and the
    choices; a bad action steps nothing.

    ## Info
    `reset` returns an empty dictionary, `step` one with

    | Key                                      | Shape  | Meaning                                  |
    | ---------------------------------------- | ------ | ---------------------------------------- |
    | `reward_height`, `reward_upright`,       |        | The terms of the reward                  |
    | `reward_position`, `reward_stillness`,   |        |                                          |
    | `reward_contact`, `reward_torque`        |        |                                          |
    | `height`, `height_command`,              |        | m, of the base above the contact points  |
    | `height_error`                           |        |                                          |
    | `torque_rms`                             |        | N·m, over joints and ticks of the step   |
    | `power`                                  |        | W, mean over the ticks of the joints'    |
    |                                          |        | summed absolute power                    |
    | `slip`                                   |        | m/s, mean speed of points on the ground  |
    | `push`                                   | (3,)   | N, world, on the last control tick       |
    | `push_velocity`                          | (3,)   | m/s, world, by which pushes changed the  |
    |                                          |        | base's velocity in this step             |
    | `torque`                                 | (n,)   | N·m, on the last control tick            |
    | `contact_force`                          | (P, 3) | N, world, of the ground on each point    |
    | `layer_saturation`                       |        | Share of the joints at their limit       |
    | `layer_residual`                         |        | Share of the weight by which the base    |
    |                                          |        | wrench misses the commanded one (layers  |
    |                                          |        | with accelerations; without limits on    |
    |                                          |        | contact forces only of `com_wrench`)     |
    | `layer_underactuation`                   |        | Base directions that the assumed         |
    |                                          |        | contacts cannot push (as before)         |
    | `termination`                            |        | "", "fall" or "diverged"                 |

    ## Version History
    * v0: Initial version.
    """
