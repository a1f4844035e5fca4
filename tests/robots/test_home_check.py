"""What the check at home says of robots that are spoilt one way at a time."""

import copy
import pickle
import re

import numpy as np
import pytest

from fbid_gym.robots import ROBOTS, Robot, load, zoo
from fbid_gym.robots.home_check import contact_of_feet
from fbid_gym.robots.measured_model import MeasuredModel
from tests.postures import posed

ANIMAL = zoo.draw(37)  # on four legs that end in spheres, with motors
TEXT = zoo.mjcf(ANIMAL)
SLIPPERY = (
    "The feet's friction is 0.4: layers assume less than the 0.6 that they would of other feet."
)


def check(text: str = TEXT, **options: object) -> list[str]:
    return Robot.from_mjcf(text, **{"feet": ANIMAL.foot_names, **options}).check()


def number(sentence: str) -> float:
    found = re.search(r"[\d.]+(e-?\d+)?", sentence.split("Joint")[-1].split("'")[-1])
    assert found is not None, sentence
    return float(found.group())


@pytest.mark.parametrize("name", ROBOTS)
def test_nothing_speaks_against_built_in_robots(name: str) -> None:
    assert load(name).check() == []


def test_geometry_in_the_ground() -> None:
    """Sites a little below the middle of the spheres, whose radius is 0.05 legs."""
    inside, names = TEXT, [f"inside{leg}" for leg in range(4)]
    for leg, name in enumerate(names):
        sphere = inside.index("<geom", inside.index(f'name="foot{leg}"'))
        site = f'<site name="{name}" pos="0 0 {(0.05 - 0.1 - 0.02) * ANIMAL.leg}"/>'
        inside = inside[:sphere] + site + inside[sphere:]
    told = check(inside, feet=names)
    assert len(told) == 1 and "in the ground at home" in told[0]
    assert number(told[0]) == pytest.approx(30.0 * ANIMAL.leg, rel=1e-2)  # mm


def test_loading_speaks_and_making_it_again_does_not(caplog: pytest.LogCaptureFixture) -> None:
    robot = Robot.from_mjcf(TEXT.replace('friction="0.8', 'friction="0.4'), name="skater")
    said = [f"skater: {SLIPPERY}"]
    assert caplog.messages == said and robot.check() == [SLIPPERY]
    pickle.loads(pickle.dumps(robot))
    assert caplog.messages == said


def test_points_above_what_touches() -> None:
    below = TEXT.replace("</body>", '<site name="below" pos="0 0 -1"/></body>', 1)
    told = check(below, feet=["below"])
    assert told[0].startswith("The robot hovers: its lowest geometry is ")


def test_uneven_feet() -> None:
    angles = {f"leg0_{joint}": 0.3 for joint in ("hip_pitch", "knee")}
    robot = Robot.from_mjcf(TEXT, ANIMAL.foot_names, home=angles)
    data = posed(robot)
    heights = [data.body(f"foot{leg}").xpos[2] for leg in range(4)]
    told = [sentence for sentence in robot.check() if "differ by" in sentence]
    assert number(told[0]) == pytest.approx(1e3 * np.ptp(heights), rel=0.2)


def test_a_centre_of_mass_outside_of_the_feet() -> None:
    told = check(feet=["foot0", "foot1"])
    words = "outside of the contact points at home: the robot will fall over"
    assert any(words in sentence for sentence in told)


def test_points_that_carry_nothing_and_others_that_do() -> None:
    told = check(TEXT, feet=["foot0", "foot3"], home=None)
    assert any("% of the weight at home, others the rest." in sentence for sentence in told)
    extra = TEXT.replace("</body>", '<site name="idle" pos="0 0 -0.0001"/></body>', 1)
    robot = Robot.from_mjcf(extra, {"a": "foot0", "b": "foot1", "c": "foot2", "d": "foot3"})
    assert robot.check() == []


def test_soft_feet_are_waited_for_until_they_carry_or_others_do() -> None:
    """Those that give way for 0.1 s sink 0.1 m; those that do for 0.5 s let the trunk come down."""
    soft, softer = (
        check(TEXT.replace('friction="0.8', f'solref="{time} 1" friction="0.8'))
        for time in (0.1, 0.5)
    )
    assert soft == []
    assert len(softer) == 1 and softer[0].endswith("% of the weight at home, others the rest.")


def test_joints_too_light_to_be_held() -> None:
    bare = re.sub(r'armature="[^"]*"', "", TEXT)
    told = [sentence for sentence in check(bare) if "give it armature=" in sentence]
    for sentence in told:
        assert number(sentence) < 1.1 * _least(sentence)
    named = {sentence.split("'")[1]: 2.0 * _least(sentence) for sentence in told}
    assert named and check(bare, armature=named) == []


def _least(sentence: str) -> float:
    return float(sentence.split("armature=")[1].split(" ")[0])


def test_springs() -> None:
    text = TEXT.replace("<joint armature", '<joint stiffness="3" springref="{}" armature')
    assert check(text.replace("{}", "0.001")) == []
    told = check(text.replace("{}", "1"))
    assert len(told) == 1 and told[0].startswith(f"Springs on {4 * ANIMAL.joints} joints (leg0_")
    assert "up to 3 N·m at home" in told[0]


@pytest.mark.parametrize("priority", ['priority="1"', ""])
@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('friction="0.8', 'friction="0.8'),
        ('friction="0.8', 'friction="1.3'),
        ('friction="0.8', 'solref="0.05 1" friction="0.8'),
        ('friction="0.8', 'solref="0.003 1" solmix="3" friction="0.8'),
        ('friction="0.8', 'solref="-3000 -90" friction="0.8'),
    ],
)
def test_contacts_are_what_mujoco_makes_of_a_foot_on_the_ground(
    old: str, new: str, priority: str
) -> None:
    """Friction and time constant, against the contacts themselves."""
    text = TEXT.replace(old, new).replace('priority="1"', priority)
    robot = Robot.from_mjcf(text, ANIMAL.foot_names)
    contact = posed(robot, robot.home_qpos - 1e-3 * np.eye(robot.nq)[2]).contact
    time, damping = contact.solref.T
    times = np.where(time > 0.0, time, -2.0 / damping)
    expected = contact.friction[:, 0].min(), times.max()
    assert contact_of_feet(robot.at_home, robot.feet) == pytest.approx(expected)


def test_feet_that_can_touch_nothing_have_no_contacts() -> None:
    robot = Robot.from_mjcf(TEXT, ANIMAL.foot_names)
    model = copy.copy(robot.model)
    model.geom_contype[:] = model.geom_conaffinity[:] = 0
    pose = MeasuredModel(model, robot.home_qpos)
    assert contact_of_feet(pose, robot.feet) == (np.inf, 0.0)
