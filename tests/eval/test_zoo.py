"""Robots drawn from seeds, standing and walking: the table says who, and how."""

import pytest

from eval.zoo import morphology
from eval.zoo.__main__ import ZooConfig, built, main, rows, stand


def test_a_row_has_what_a_robot_can():
    """On points it stands and walks; six legs stand, as there is no gait for them."""
    config = ZooConfig(seeds=(0, 1), layers=("joint_position",), episodes=2, seconds=0.2)
    head, _, on_points, on_six = rows(config)
    assert "`joint_position`" in head
    assert on_points.startswith("| 0 | 29.2 kg, 4 legs") and "| 2, " in on_points
    assert on_points.count(";") == 1 and on_six.count(";") == 0 and "6 legs" in on_six


def test_who_has_no_feedback_falls():
    robot = built(morphology.draw(0))
    assert stand(robot, "joint_position", 2, 1.0).survival == 1.0
    assert stand(robot, "torque", 2, 4.0).survival == 0.0


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--seeds", "-1"], "Invalid seeds: -1. Expected a whole number from 0"),
        (["--layers", "magic"], "Unknown action layer 'magic'. Valid choices: torque"),
        (["--seconds", "0"], "Invalid seconds: 0.0"),
    ],
)
def test_nonsense_is_one_line(capsys, arguments, message):
    assert main(arguments) == 2
    assert message in capsys.readouterr().err
