"""The environments whose task is to walk on ground that is not level, described."""

from fbid_gym.envs.robot_env import RobotEnv


class TerrainEnv(RobotEnv):
    """A robot walks to velocity commands over ground that it does not know, or sees.

    ## Description
    Task `walk`, with everything that belongs to it, on slopes, rough ground, stairs, planks
    or gaps.

    | Id                            | Robot | Terrain                                              |
    | ----------------------------- | ----- | ---------------------------------------------------- |
    | `fbid_gym/QuadrupedTerrain-v0`| go1   | `mixed`                                              |
    | `fbid_gym/BipedTerrain-v0`    | biped | `mixed`                                              |

    The ground is a square of five by five patches, each 14 heights h of the centre of mass long
    (h: at home; 3.8 m for `go1`, 9.9 m for `biped`), level in the middle and along the edge. At
    difficulty d, with c = 1 for robots on point feet and c = 0.2 for those on soles:

    | Terrain     | What it is                              | Size                                 |
    | ----------- | --------------------------------------- | ------------------------------------ |
    | `slopes`    | hills with four even sides              | tangent 0.47 c d (25 degrees)        |
    | `roughness` | random heights 0.6 h apart, joined      | up to 0.35 c d h                     |
    | `stairs`    | steps of 1 h up to a level top          | 0.45 c d h each                      |
    | `planks`    | low obstacles lying about               | 0.2 c d h to 0.4 c d h high          |
    | `gaps`      | raised ground, two gaps 2 h apart       | 0.7 d h wide, c d h deep             |
    | `mixed`     | patches of all of these                 |                                      |

    Difficulty 0 is level. The sides of stairs, planks and gaps are 0.14 h wide, a cell of the
    height field. Gaps go around the middle of a patch, 2 h and 4 h away; from middle to middle of
    their sides they are whole cells wide, at least one.

    ## Action Space
    As in the other environments of task `walk`.

    ## Observation Space
    As in the other environments of task `walk`: blind. `height_scan=True` adds 35 entries, the
    height of the ground (m, at most 10) above that under the feet, at the places
    `fbid_gym.tasks.height_scan.SCAN` times h: from 1 h behind to 2 h ahead of the base and up to
    0.8 h beside it, in the frame of its heading. Then the gait knows the ground as well: it sets
    feet down at its height. Otherwise it takes the ground to be the plane on which its feet stood.

    ## Rewards
    As in the other environments of task `walk`.

    ## Starting State
    On one of the nine inner patches, in its level middle.

    ## Episode End
    A fall, judged by the height of the base above the feet and by its tilt, or a divergence
    terminates. `episode_seconds` truncates, and so does the end of the ground: at top speed a robot
    gets there before 20 s have passed, from an outer start after 21 h.

    ## Arguments
    Those of the other environments of task `walk`, and

    | Parameter      | Default   | Description                                                   |
    | -------------- | --------- | ------------------------------------------------------------- |
    | `terrain`      | `"mixed"` | Also each kind above, `"flat"`, `"obstacles"` and `"rocks"`   |
    | `terrain_seed` | `0`       | Decides what is random in it                                  |
    | `difficulty`   | `0.5`     | From 0 to 1                                                   |
    | `curriculum`   | `False`   | Whether robots move through eleven levels, difficulty 0 to 1, |
    |                |           | and begin at that nearest to `difficulty`                     |
    | `height_scan`  | `False`   | Whether robot and policy see the ground                       |

    With a curriculum, a robot that does not fall and whose mean error of velocity is at most
    0.12 sqrt(g h) starts its next episode one level higher, one that falls one level lower.
    `reset(seed=...)` takes it back to the first one; `state_dict` keeps it.

    ## Info
    As in the other environments of task `walk`; with a curriculum also `terrain_level`, 0 to 10, of
    the present episode.

    ## Version History
    * v0: Initial version.
    """
