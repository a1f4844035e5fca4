"""Tasks and layers of a user's: what is refused of them, and that they work."""

from dataclasses import dataclass, field
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import numpy as np
import pytest

from fbid_gym.actions import LAYERS, register_layer
from fbid_gym.envs.registered import resolved_arguments
from fbid_gym.errors import FbidError, InvalidValueError, ShapeError, UnknownOptionError
from fbid_gym.motions import home_target, in_world
from fbid_gym.motions.target import planned_kind
from fbid_gym.options import Number
from fbid_gym.tasks import TASKS, Episode, Group, Term, register_task
from fbid_gym.tasks.outcome import Outcome
from tests.batches import begun

ENV = "fbid_gym/QuadrupedBalance-v0"


pytestmark = pytest.mark.usefixtures("registries")


@dataclass(frozen=True)
class Limp:
    """No torque, or what it is told to answer."""

    count: int
    answer: Any = None
    diagnostics: tuple[str, ...] = ()
    action_names: tuple[str, ...] = ("nothing",)
    rows: int | None = None

    def memory(self, num_robots: int) -> dict[str, np.ndarray]:
        return {} if self.rows is None else {"way": np.zeros(self.rows)}

    def torque(self, action, state, target, terms, memory):
        return np.zeros((len(action), self.count)) if self.answer is None else self.answer


def limp(robot: Any, control_hz: int, kind: Any, *, answer: Any = None) -> Limp:
    return Limp(robot.num_joints, answer)


class Rested(NamedTuple):
    """What is measured."""

    outcome: Outcome


@dataclass(frozen=True, eq=False, kw_only=True)
class Rest(Episode):
    """Rest at home; each answer can be another."""

    answers: dict[str, Any] = field(default_factory=dict)

    @property
    def observation_groups(self) -> Any:
        groups = self.answers.get("groups", {})
        return self.body.groups | groups if isinstance(groups, dict) else groups

    @property
    def reward_terms(self) -> Any:
        ones = Term(lambda measured: np.ones(len(measured.outcome.power)), 1.0)
        answer = self.answers.get("share", ones)
        terms = {"rest": ones if answer is ones else Term(lambda measured: answer, 1.0)}
        return self.answers.get("terms", terms)

    def draw(self, rng):
        robot = self.body.robot
        drawn = {"qpos": robot.home_qpos, "qvel": np.zeros(robot.nv)}
        drawn |= self.pushes.draw(rng, self.seconds, self.hz)
        return self.answers.get("plan", lambda plan: plan)(drawn)

    def memory(self, terms):
        return self.answers.get("memory", {})

    @property
    def kind(self):
        return planned_kind(self.body.robot)

    def on(self, ground):
        return self

    def advance(self, plan, now):
        pass

    def target(self, plan, now):
        return in_world(self.body.stance.heading, home_target(self.body.robot), now.terms())

    def measure(self, outcome, plan, memory):
        return Rested(outcome)

    def metrics(self, measured):
        return self.answers.get("metrics", {})


def rest(episode, *, answers=None) -> Rest:
    return Rest.from_episode(episode, answers=answers or {})


def stepped(**arguments: Any) -> tuple[Any, ...]:
    envs = begun(ENV, 2, **arguments)
    return envs.step(np.zeros(envs.action_space.shape))


def test_a_layer_goes_wherever_those_of_the_package_go() -> None:
    register_layer("limp", limp)
    *_, info = stepped(action_layer="limp")
    assert info["torque"].shape == (2, 12) and not info["torque"].any()
    resolved = resolved_arguments(ENV, {"action_layer": "limp"})
    added = {"footholds": False, "step_rate": False, "residual_torque": 0.0}
    assert resolved is not None and resolved["layer_options"] == {"answer": None} | added
    with pytest.raises(UnknownOptionError, match="of action layer 'limp'.*answer"):
        gym.make(ENV, action_layer="limp", layer_options={"scale": 1.0})
    gym.make("fbid_gym/QuadrupedWalk-v0", action_layer="limp", layer_options={"footholds": True})


def test_a_task_goes_wherever_those_of_the_package_go() -> None:
    register_task("rest", rest, push=(0.1, 0.2))
    _, reward, *_, info = stepped(task="rest", action_layer="base_acceleration")
    np.testing.assert_array_equal(reward, 1.0)
    assert info["reward_rest"].tolist() == [1.0, 1.0]
    env = gym.make(ENV, task="rest").unwrapped
    weight = env.batch.robot.weight
    assert env.batch.task.pushes.force == pytest.approx((0.1 * weight, 0.2 * weight))
    with pytest.raises(UnknownOptionError, match="unexpected keyword argument 'height_range'"):
        gym.make(ENV, task="rest", height_range=(0.9, 1.0))


def test_names_constructors_and_pushes_that_are_refused() -> None:
    """Nothing is registered, and those of the package stay."""
    names: tuple[Any, ...] = ("torque", "two words", "", 3, None)
    of_layers: tuple[Any, ...] = (None, lambda r, hz: None, lambda r, hz, kind, *, k: None)
    of_tasks: tuple[Any, ...] = (None, lambda: None, lambda episode, *, k: None)
    pushes: tuple[Any, ...] = ((0.2, 0.1), 0.3, (-0.1, 0.2))
    for name in names:
        with pytest.raises(InvalidValueError, match="name of action layer.*com_wrench"):
            register_layer(name, limp)
    with pytest.raises(InvalidValueError, match="name of task: 'walk'"):
        register_task("walk", rest)
    for build in of_layers:
        with pytest.raises(InvalidValueError, match=r"of mine.*\(robot, control_hz, kind\)"):
            register_layer("mine", build)
    for build in of_tasks:
        with pytest.raises(InvalidValueError, match=r"constructor of mine.*\(episode\)"):
            register_task("mine", build)
    for push in pushes:
        with pytest.raises(InvalidValueError, match="push"):
            register_task("mine", rest, push=push)
    assert LAYERS["torque"] is not limp and "mine" not in {*LAYERS, *TASKS}


def test_torques_that_are_refused() -> None:
    register_layer("limp", limp)
    for answer, error in (
        (np.zeros((2, 11)), ShapeError),
        (np.zeros(12), ShapeError),
        ("nothing", InvalidValueError),
        (object(), InvalidValueError),
    ):
        with pytest.raises(error, match="torque of Limp"):
            stepped(action_layer="limp", layer_options={"answer": answer})


def test_torques_of_drives_that_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    register_layer("limp", limp)
    late: dict[str, Any] = {"action_layer": "limp", "randomisation": {"loop_delay": (0.0, 0.01)}}
    stepped(**late)  # a layer that says nothing of drives
    monkeypatch.setattr(Limp, "drive_torque", lambda layer, state: np.zeros(12), raising=False)
    with pytest.raises(ShapeError, match=r"drive_torque of Limp.*\(12,\).*\(2, 12\)"):
        stepped(**late)


WIDE = Group(("z",), 1.0, lambda measured: np.zeros((2, 3)))


@pytest.mark.parametrize(
    ("answers", "words"),
    [
        ({"plan": lambda plan: None}, "plan drawn by Rest"),
        ({"plan": lambda plan: plan | {"pace": 0.5}}, "'pace' drawn by Rest.*an array"),
        ({"plan": lambda plan: plan | {"qpos": np.zeros(3)}}, r"'qpos' drawn by Rest.*\(19,\)"),
        ({"groups": None}, "observation_groups of Rest: None"),
        ({"groups": {"up": WIDE}}, r"observation group 'up' of Rest has shape \(2, 3\).*\(2, 1\)"),
        ({"terms": np.ones(2)}, "reward_terms of Rest"),
        ({"terms": {"rest": Term(len, -1.0)}}, "weight of reward term 'rest': -1.0"),
        ({"share": 1.0}, r"reward term 'rest' of Rest has shape \(\)"),
        ({"metrics": None}, "metrics of Rest: None"),
        ({"metrics": {"speed": np.zeros((2, 3))}}, "metric 'speed' of Rest"),
        ({"share": np.array([1.0, np.nan])}, r"reward term 'rest' of Rest.*\(1,\)"),
        ({"memory": None}, "memory of Rest: None.*dictionary"),
        ({"memory": {"way": np.zeros(3)}}, r"'way' in the memory of Rest.*\(3,\).*\(2, \.\.\.\)"),
    ],
)
def test_answers_of_a_task_that_are_refused(answers: dict[str, Any], words: str) -> None:
    register_task("rest", rest)
    with pytest.raises(FbidError, match=words):
        stepped(task="rest", answers=answers, action_layer="torque")


@pytest.mark.parametrize(
    ("own", "words"),
    [
        ({"action_names": None}, "action_names of Limp: None.*a tuple of names"),
        ({"diagnostics": ("way",)}, "diagnostics of Limp: 'way'.*in its memory: none"),
        ({"rows": 3}, r"'way' in the memory of Limp has shape \(3,\)"),
    ],
)
def test_layers_that_are_refused(own: dict[str, Any], words: str) -> None:
    register_layer("limp", lambda robot, hz, kind: Limp(robot.num_joints, **own))
    with pytest.raises(FbidError, match=words):
        gym.make_vec(ENV, num_envs=2, action_layer="limp")


@pytest.mark.parametrize(
    ("later", "words"),
    [
        (lambda plan: {k: v for k, v in plan.items() if k != "push_start"}, "plan drawn by Rest"),
        (lambda plan: plan | {"qpos": np.zeros(3)}, r"'qpos' drawn by Rest has shape \(3,\)"),
    ],
)
def test_episodes_that_differ_from_the_first_are_refused(later: Any, words: str) -> None:
    drawn = []

    def plan(usual: dict[str, Any]) -> dict[str, Any]:
        drawn.append(usual)
        return usual if len(drawn) < 4 else later(usual)

    register_task("rest", rest)
    envs = begun(ENV, 2, task="rest", answers={"plan": plan})
    with pytest.raises(FbidError, match=words):
        envs.reset(seed=0)


def test_what_a_task_answers_stays_the_tasks() -> None:
    """A constant of its own, which not even a robot that diverges changes."""
    ones = np.ones(2)
    ones.flags.writeable = False
    register_task("rest", rest)
    envs = begun(ENV, 2, task="rest", answers={"share": ones})
    envs.chunks.batches[0].simulation.qvel[1] = np.nan
    _, reward, *_ = envs.step(np.zeros(envs.action_space.shape))
    assert reward.tolist() == [1.0, 0.0]


@dataclass(frozen=True)
class Softness:
    """Options that stand together."""

    give: Annotated[float, Number(0.0, 1.0)] = 0.5


def test_options_of_a_users_layer_and_task_may_stand_together() -> None:
    """Whatever they are called; also beside one whose name this package uses for a group."""
    built = []

    def soft(robot, hz, kind, *, contact: bool = True, own: Softness = Softness()) -> Limp:
        built.append((contact, own.give))
        return Limp(robot.num_joints)

    def task(episode, *, own: Softness = Softness()) -> Rest:
        built.append(own.give)
        return Rest.from_episode(episode)

    register_layer("soft", soft)
    register_task("mine", task)
    gym.make(ENV, action_layer="soft", layer_options={"give": 0.25, "contact": False})
    gym.make(ENV, action_layer="soft")
    gym.make(ENV, task="mine", give=0.75)
    assert built == [(False, 0.25), (True, 0.5), 0.75]
    with pytest.raises(UnknownOptionError, match="option 'own' of action layer 'soft'.*give"):
        gym.make(ENV, action_layer="soft", layer_options={"own": Softness()})
