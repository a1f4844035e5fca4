"""Nonsense on the command line of what measures without a policy: one line, exit status 2."""

import pytest

from eval import rollout, terrain, walking

WALK = ["--zero-action", "--env", "fbid_gym/QuadrupedWalk-v0"]


@pytest.mark.parametrize(
    ("main", "arguments", "message"),
    [
        (walking.main, ["--robots", "horse"], "Unknown robot 'horse'. Valid choices: go1, quad"),
        (walking.main, ["--layers", "torque", "magic"], "action layer 'magic'. Valid choices: tor"),
        (walking.main, ["--episodes", "-3"], "Invalid episodes: -3. Expected a positive whole"),
        (walking.main, ["--seconds", "-1"], "Invalid seconds: -1.0. Expected a positive finite"),
        (walking.main, ["--push", "-50"], "Invalid push: -50.0. Expected a finite number of at le"),
        (terrain.main, ["--envs", "fbid_gym/Moon-v0"], "Unknown environment 'fbid_gym/Moon-v0'. V"),
        (terrain.main, ["--envs", "fbid_gym/BipedBalance-v0"], "Valid choices: fbid_gym/Quadruped"),
        (terrain.main, ["--layers", "magic"], "Unknown action layer 'magic'. Valid choices: torq"),
        (terrain.main, ["--terrains", "lava"], "Unknown terrain 'lava'. Valid choices: slopes, "),
        (terrain.main, ["--difficulties", "0.5", "-1"], "Invalid difficulty: -1.0. Expected a num"),
        (terrain.main, ["--robots", "-2"], "Invalid robots: -2. Expected a positive whole number"),
        (terrain.main, ["--seconds", "nan"], "Invalid seconds: nan. Expected a positive finite"),
        (rollout.main, [*WALK, "--action-layer", "magic"], "Unknown action layer 'magic'. Valid c"),
        (rollout.main, [*WALK, "--env-args", '{"robot": "horse"}'], "Unknown robot 'horse'. Valid"),
        (rollout.main, [*WALK, "--env-args", '{"gait": "hop"}'], "Unknown gait 'hop'. Valid choic"),
        (rollout.main, [*WALK, "--episodes", "-3"], "Invalid episodes: -3. Expected a positive"),
        (rollout.main, [*WALK, "--seed", "-1"], "Invalid seed: -1. Expected a whole number of at"),
        (rollout.main, [*WALK, "--video-seconds", "-1"], "Invalid video_seconds: -1.0. Expected a"),
    ],
)
def test_nonsense_is_one_line(main, arguments, message, capsys):
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.err.startswith("error: ") and captured.err.count("\n") == 1
    assert message in captured.err and "Traceback" not in captured.out + captured.err
