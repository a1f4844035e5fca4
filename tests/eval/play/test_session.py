"""Sessions without a viewer: what is asked happens, exactly, and nothing else does."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from eval.play.controls import controls
from eval.play.session import Change, ChangeAll, OneStep, Push, Request, Reset, Session
from eval.play.stage import Stage
from eval.play.texts import from_words, to_query, words_of
from fbid_gym.envs.insight import insight
from fbid_gym.errors import FbidError
from fbid_gym.options import Number
from fbid_gym.policy import Policy
from fbid_gym.tasks.body_view import own_units
from tests.eval.conftest import constant_policy

WALK = "fbid_gym/QuadrupedWalk-v0"


STAGE = Stage.of(WALK, {"action_layer": "base_acceleration"}, {})


def walking(**settings: Any) -> Session:
    return Session(STAGE, settings)


def same(one: dict[str, np.ndarray], other: dict[str, np.ndarray], but: tuple[str, ...]) -> bool:
    names = [name for name in one if not name.startswith(but)]
    return all(np.array_equal(one[name], other[name]) for name in names)


def test_the_same_requests_at_the_same_times_give_the_same_robots():
    timed: list[tuple[int, Request]] = [
        (3, Change("ahead", 0.4)),
        (10, Push((20.0, 30.0, 0.0), 0.1)),
        (20, Change("beside", "joint_position")),
        (25, Change("layer", "com_wrench")),
        (30, Change("action_delay", 0.02)),
    ]
    first, second, other = walking(seed=5), walking(seed=5), walking(seed=6)
    for session in (first, second, other):
        session.play(timed, 40)
    for one, two in zip(first.lanes, second.lanes, strict=True):
        assert same(one.state(), two.state(), ())
    assert len(first.lanes) == 2
    assert not np.array_equal(first.lanes[0].qpos, other.lanes[0].qpos)


def test_a_switch_of_layer_carries_all_but_the_layers_memory():
    session = walking(ahead=0.3)
    session.play([], 30)
    before, torque = session.lanes[0].state(), session.lanes[0].last.info["torque"]
    session.submit(Change("layer", "joint_position"))
    session.settle()
    after = session.lanes[0].state()
    # A zero action is on its way either way; there are as many of its entries as the layer has.
    assert same(before, after, ("memory.", "delay.action"))
    session.play([], 1)
    assert session.lanes[0].player.layer == "joint_position"
    assert not np.allclose(session.lanes[0].last.info["torque"], torque, atol=0.1)
    session.play([(0, Change("layer", "base_acceleration"))], 50)
    session.play([(0, Change("contact_limits", "none"))], 1)
    assert session.lanes[0].batch.layer.law.limited is False
    assert session.lanes[0].fallen is None


def test_a_push_lasts_as_long_as_asked_and_pushes_everybody():
    session, still = walking(beside="joint_position"), walking()
    seen = []
    session.submit(Push((0.0, 40.0, 0.0), 0.1))
    for _ in range(8):
        session.advance()
        seen.append([lane.push_force[1] for lane in session.lanes])
    still.play([], 8)
    assert seen == [[40.0, 40.0]] * 5 + [[0.0, 0.0]] * 3
    for lane in session.lanes:
        assert lane.qpos[1] > still.lanes[0].qpos[1] + 0.005
    session.submit(Push((0.0, 40.0, 0.0), 1.0))
    session.advance()
    session.submit(Push((0.0, 0.0, 0.0), 0.0))
    session.advance()
    assert not session.lanes[0].push_force.any()


def test_settings_change_what_they_name_and_while_it_runs():
    session = walking()
    session.play([], 5)
    lane = session.lanes[0]
    before = lane.state()
    mass, mu = lane.batch.robot.mass, lane.batch.simulation.model.geom_friction[0, 0]
    asked = {"added_mass": 3.0, "friction": 0.5, "model_mass": 1.2, "motors": 0.8}
    asked |= {"action_delay": 0.04, "loop_delay": 6.0, "ahead": 0.2, "turn": -0.3}
    for name, value in asked.items():
        session.submit(Change(name, value))
    session.settle()
    after, batch = lane.state(), lane.batch
    changed = ("plant.", "delay.ticks", "simulation.loop_ticks", "plan.command")
    assert session.lanes[0] is lane and same(before, after, changed)
    assert batch.simulation.terms().mass_matrix[0, 0, 0] == pytest.approx(mass + 3.0)
    assert batch.plant.terms().mass_matrix[0, 0, 0] == pytest.approx(1.2 * mass)
    assert batch.simulation.batch.expand("geom_friction")[0, 0, 0] == pytest.approx(0.5 * mu)
    assert after["delay.ticks"] == 10 and batch.simulation.loop.arrays["ticks"] == 1.5
    session.advance()
    names = list(batch.observation_names)
    seen = batch.observation()[0, names.index("commanded velocity ahead (m/s)") :][:3]
    assert seen == pytest.approx([0.2, 0.0, -0.3])
    # A reset leaves them as they are.
    session.play([(0, Reset())], 1)
    assert batch.simulation.terms().mass_matrix[0, 0, 0] == pytest.approx(mass + 3.0)


def test_sensors_are_chosen_and_err_by_as_much_as_asked():
    """Switched in a robot that walks; another layer goes on with the same estimate."""
    session = walking(ahead=0.2)
    assert session.settings["sensors"] == "perfect" and session.lanes[0].believed is None
    wrong = []
    for noise in (0.0, 3.0):
        wanted = {"ahead": 0.2, "sensors": "mems", "noise": noise}
        session.play([(0, ChangeAll(wanted))], 40)
        lane = session.lanes[0]
        assert session.refused == "" and lane.fallen is None
        wrong.append(np.linalg.norm(lane.believed - lane.qpos[:7]))
        assert lane.batch.config.perceived().scale == noise
    assert wrong[0] < 0.5 * wrong[1]
    before = lane.state()
    session.submit(Change("layer", "com_wrench"))
    session.settle()
    assert same(before, session.lanes[0].state(), ("memory.", "delay.action"))


def test_sensors_of_ones_own_are_those_it_begins_with():
    own = {"like": "good", "scale": 2.0}
    stage = Stage.of(WALK, {"sensors": own}, {})
    session = Session(stage, {"noise": 1.5})
    assert stage.sensors == ("as begun", "perfect", "good", "mems", "raw")
    assert session.lanes[0].batch.config.sensors == own | {"scale": 3.0}
    measured = Stage.of(WALK, {"sensors": "mems", "observation": "measured"}, {})
    session = Session(measured)
    assert session.settings["sensors"] == "mems"
    session.play([(0, Change("sensors", "perfect"))], 1)
    assert "observation" in session.refused and session.settings["sensors"] == "mems"


def test_who_is_paused_goes_a_step_at_a_time_and_who_falls_starts_anew():
    session = walking(paused=True)
    session.play([(2, OneStep())], 5)
    assert session.steps == 1
    session.submit(Change("paused", False))
    session.submit(Change("policy", "zero action"))
    session.play([(0, Change("layer", "torque")), (0, Push((150.0, 190.0, 0.0), 2.0))], 60)
    assert session.lanes[0].fallen is not None
    session.play([], 100)
    assert np.linalg.norm(session.lanes[0].qpos[:2]) < 1.0 and session.lanes[0].batch.task.seconds


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        (Change("ahead", 50.0), "Invalid ahead: 50.0. Expected a number from -0.57 to 0.945."),
        (Change("ahead", float("nan")), "Expected a number from"),
        (Change("layer", "magic"), "Unknown layer 'magic'. Valid choices: torque,"),
        (Change("policy", "runs/other"), "Valid choices: zero action."),
        (Push((1e4, 0.0, 0.0), 0.1), "a force of at most 250 N"),
        (Push((float("inf"), 0.0, 0.0), 0.1), "three numbers of N"),
        (Push("abc", 0.1), "three numbers of N"),  # type: ignore[arg-type]
        (Push((1.0, 0.0, 0.0), 60.0), "a time of 0 to 2 s"),
        (ChangeAll({"ahead": 0.1, "added_mass": -1.0}), "Invalid added_mass: -1.0. Expected"),
        ("import os", "a Change, ChangeAll, Push, Reset or OneStep"),
    ],
)
def test_what_may_not_be_asked_is_refused_before_anything_changes(request_, words, session_):
    with pytest.raises(FbidError, match=words.replace("(", r"\(")):
        session_.submit(request_)
    assert not session_.waiting


@pytest.fixture(scope="module")
def session_():
    return walking()


def test_a_policy_brings_its_layer_and_leaves_with_it(session_):
    seen = session_.lanes[0].batch.observation().shape[1]
    own = {"action_layer": "joint_position", "layer_options": {"scale": 0.1}}
    good = constant_policy(WALK, seen, np.full(12, 0.1), env_args=own)
    odd = constant_policy(WALK, 7, np.zeros(12), env_args={"action_layer": "torque"})
    stage = Stage.of(WALK, {}, {"good": good, "odd": odd})
    session = Session(stage, {"policy": "good"})
    assert session.settings["layer"] == "joint_position"
    session.play([(2, Change("policy", "zero action"))], 4)
    assert session.settings["layer"] == "joint_position" and not session.lanes[0].action.any()
    session.play([(0, Change("policy", "good"))], 2)
    assert session.lanes[0].action == pytest.approx(np.full(12, 0.1))
    assert session.lanes[0].batch.config.layer_options == {"scale": 0.1}
    lanes = session.lanes
    session.play([(0, Change("policy", "odd"))], 1)
    assert "7" in session.refused and session.lanes is lanes
    assert session.settings["policy"] == "good"
    session.play([(0, Change("layer", "com_wrench")), (1, Change("beside", "good"))], 3)
    assert session.settings["policy"] == "zero action" and session.refused == ""
    players = [("com_wrench", "zero action"), ("joint_position", "good")]
    assert [lane.player for lane in session.lanes] == players


def test_it_opens_on_a_robot_that_walks_and_says_how_fast():
    session = Session(STAGE)
    session.play([], 100)
    lane = session.lanes[0]
    wanted, speed = session.settings["ahead"], lane.last.info["speed"][0]
    assert 0.4 < wanted < 0.5 and abs(speed - wanted) < 0.2 * wanted
    assert lane.word == f"**{speed:.2f} m/s**, command {wanted:.2f} m/s, falls: 0"
    session.play([(0, Change("layer", "torque"))], 100)
    assert session.lanes[0].word.endswith("falls: 1")
    session.play([(0, Reset())], 1)
    assert session.lanes[0].word.endswith("falls: 0")


def other(control: Any) -> Any:
    """Another value than at the start."""
    kind, now = control.kind, control.default
    if isinstance(kind, Number):
        return kind.most if now == kind.least else kind.least
    return next(each for each in getattr(kind, "names", (True, False)) if each != now)


def test_every_setting_travels_by_link_and_acts_elsewhere():
    """Also on a page that has begun with other ones."""
    policies = {"good": Policy.load("shipped:QuadrupedWalk-v0/joint_position_gait")}
    robots = ("go1", "quadruped")
    here = Stage.of(WALK, {"action_layer": "base_acceleration"}, policies).among(robots)
    elsewhere = Stage.of(WALK, {"action_layer": "com_wrench", "gait": "pace"}, policies)
    elsewhere = elsewhere.among(robots)
    session = Session(here)
    wanted = {name: other(control) for name, control in session.offers("quadruped").items()}
    session.submit(ChangeAll(wanted | {"layer": "joint_position"}))  # the policy's
    session.settle()
    assert session.refused == ""
    assert all(session.settings[n] != each.default for n, each in session.offered.items())
    for there in (here, elsewhere):
        offered = Session(there).offers("quadruped")
        given = from_words(offered, words_of(to_query(session.offered, session.settings)))
        assert Session(there, given).settings == session.settings
    untouched = Session(here)
    words = words_of(to_query(untouched.offered, untouched.settings))
    given = from_words(controls(elsewhere), words)
    assert Session(elsewhere, given).settings == untouched.settings


def test_another_robot_takes_over_at_its_own_scale():
    """Who acts by bodies acts on it; who sees joints is refused in words, and nothing changes."""
    drawn = "zoo:quadruped:3"  # of 16 joints
    stage = Stage.of(WALK, {"action_layer": "base_acceleration", "observation": "body"}, {})
    sees = stage.task().body  # go1
    size = Session(stage).lanes[0].batch
    shape = size.observation().shape[1], np.zeros(len(size.action_names))
    body = constant_policy(WALK, *shape, env_args={"action_layer": "base_acceleration"})
    joints = constant_policy(WALK, 62, np.zeros(12), env_args={"action_layer": "joint_position"})
    stage = replace(stage, policies={"body": body, "joints": joints}).among(("go1", drawn))
    session = Session(stage)
    before, weight = session.settings, session.weight
    session.play([(0, Change("policy", "body")), (0, Change("robot", drawn))], 3)
    assert session.refused == "" and session.lanes[0].batch.robot.num_joints == 16
    robot = session.lanes[0].batch.task.body
    ratio = own_units(robot).speed / own_units(sees).speed
    assert session.settings["ahead"] == pytest.approx(ratio * before["ahead"], rel=0.01)
    share = session.settings["push_force"] / session.weight
    assert share == pytest.approx(before["push_force"] / weight, rel=0.05)  # whole N
    session.play([(0, Change("policy", "joints"))], 1)
    assert "sees 12 joints" in session.refused and session.settings["policy"] == "body"
    session.play([(0, Change("robot", "go1"))], 1)
    assert session.refused == "" and session.lanes[0].batch.robot.num_joints == 12
    assert session.settings["ahead"] == pytest.approx(before["ahead"], rel=0.01)
    with pytest.raises(FbidError, match="robot"):
        session.submit(Change("robot", "zoo:quadruped:4"))


@pytest.mark.parametrize("layer", ["base_acceleration", "com_wrench", "joint_position"])
def test_insight_disturbs_nothing_and_adds_up(layer):
    stage = Stage.of("fbid_gym/BipedBalance-v0", {"action_layer": layer}, {})
    session = Session(stage, {"seed": 3})
    session.play([], 100)
    lane = session.lanes[0]
    before, weight = lane.state(), session.weight
    seen = insight(lane.batch)
    assert same(before, lane.state(), ())
    assert seen.measured.sum(axis=0) == pytest.approx([0.0, 0.0, weight], abs=0.02 * weight)
    # Who stands still is held up by what is commanded, too.
    assert seen.commanded.sum(axis=0) == pytest.approx([0.0, 0.0, weight], abs=0.02 * weight)
    assert seen.pressure[:2] == pytest.approx(seen.com[:2], abs=0.02)
    assert seen.capture_point[:2] == pytest.approx(seen.com[:2], abs=0.02)
    assert np.isnan(seen.desired).all() == (layer == "joint_position")
    if layer != "joint_position":
        assert np.linalg.norm(seen.desired) < 0.3
