"""Every option of environments, tasks, layers and randomisation against what is none of its values.

The list is made of the options themselves: a new one is tried, too.
"""

import itertools
import json
from dataclasses import MISSING
from decimal import Decimal

import gymnasium as gym
import numpy as np
import pytest

import fbid_gym
from fbid_gym.actions import LAYERS, layer_choices, make_layer
from fbid_gym.envs.chunks import Chunks
from fbid_gym.envs.overlays import RenderOptions
from fbid_gym.envs.rendering import RobotRenderer
from fbid_gym.errors import FbidError, shown
from fbid_gym.estimation import Sensors
from fbid_gym.motions.target import MotionKind, planned_kind
from fbid_gym.options import Choice, Flag, Named, Number, Pair, Whole, options_of
from fbid_gym.robots import load
from fbid_gym.runtime.config import Drawing, EnvConfig
from fbid_gym.runtime.randomisation import Randomisation
from fbid_gym.tasks import TASKS, Pushes, Start, make_task
from tests.batches import assert_same, begun

BIPED = "fbid_gym/BipedBalance-v0"
ROBOT_OF = {"crawl": "quadruped", "walk": "go1"}


class Hostile:
    """Neither shown nor compared."""

    __hash__ = None

    def __repr__(self):
        raise RuntimeError

    def __eq__(self, other):
        raise RuntimeError


NONSENSE = (
    "text", "12", b"1", {0.5, 1.0}, np.nan, -np.inf, -1e150, -1e300, 10**400, -(10**5000), 1j,
    [], {}, np.array(["a"]), np.zeros((2, 2)),
    np.float32("nan"), np.ma.masked, Decimal("NaN"), object(),
    Hostile(), "x" * 10**5, int,
)  # fmt: skip
HUGE = (1e150, 1e300, 10**30)
PAIRS = (
    (np.nan, 1), (1e300, 1e300), (-1e300, 1e300), (1, 10**400), ("1", "2"), (None, 1), (1,),
    (1, 2, 3), {0.5: 1, 1.0: 2}, (2.0, 1.0), (1j, 2), ({1}, {2}), "ab", 1.0,
)  # fmt: skip


def bad_values(option):
    """What an option refuses; iterators without end among it."""
    named = isinstance(option.kind, Named)
    yield from (value for value in NONSENSE if not (named and isinstance(value, dict)))
    yield itertools.count()
    yield (x for x in (0.9, 1.0))
    if not option.optional and option.default is not None:
        yield None
    if isinstance(option.kind, Pair):
        yield from PAIRS
    elif not isinstance(option.kind, Flag | Choice):
        yield True
        if option.name != "max_normal_force":
            yield from (*HUGE, np.inf)
    if isinstance(option.kind, Flag):
        yield from (0, 1.0)
    if isinstance(option.kind, Whole):
        yield from (option.kind.least - 1, option.kind.most + 1)
    elif isinstance(option.kind, Number | Pair):
        low, high = np.nextafter([option.kind.least, option.kind.most], [-np.inf, np.inf]).tolist()
        outside = [low] if np.isinf(high) else [low, high]
        pair = isinstance(option.kind, Pair)
        yield from ((min(value, option.kind.most), value) if pair else value for value in outside)


def test_values_by_name_refuse_nonsense_by_name():
    for value in (*NONSENSE, *HUGE, True, None, -1.0, np.inf):
        with pytest.raises(FbidError) as caught:
            EnvConfig.of({"reward_weights": {"torque": value}})
        said = str(caught.value)
        assert "reward_weights['torque']" in said and shown(value) in said, said


def tried():
    """Each option with the door by which its values get in."""
    pushes, start = Pushes((0.0, 0.0), 0.15, (1.5, 3.0)), Start()
    for option in options_of(EnvConfig).values():
        if option.kind is not None:
            yield "environment", option, lambda name, value: EnvConfig.of({name: value})
    for option in options_of(Randomisation).values():
        yield "randomisation", option, lambda n, value: EnvConfig.of({"randomisation": {n: value}})
    for option in options_of(Sensors).values():
        yield "sensors", option, lambda name, value: EnvConfig.of({"sensors": {name: value}})
    for option in options_of(Drawing).values():
        if option.kind is not None:
            yield "drawing", option, lambda name, value: Drawing(**{name: value})

    def drawn(name, value):
        RobotRenderer(Drawing(render_options={name: value}), load("biped"))

    for option in options_of(RenderOptions).values():
        yield "render options", option, drawn
    for task, kind in TASKS.items():

        def of_task(name, value, task=task):
            robot = load(ROBOT_OF.get(task, "biped"))
            make_task(task, robot, 10.0, 500, pushes, start, {name: value})

        for option in options_of(kind.of).values():
            yield f"task {task}", option, of_task
    planned = planned_kind(load("biped")), load("biped")
    walking = MotionKind(True, 6.0), load("go1")
    for layer, (kind, robot) in zip(LAYERS, itertools.cycle([planned, walking]), strict=False):

        def of_layer(name, value, layer=layer, kind=kind, robot=robot):
            make_layer(layer, robot, 250, kind, {name: value})

        for option in layer_choices(layer).values():
            yield f"layer {layer}", option, of_layer


TRIED = list(tried())


@pytest.mark.parametrize("door", dict.fromkeys(case[0] for case in TRIED))
def test_every_option_refuses_nonsense_by_name(door):
    for option, give in (case[1:] for case in TRIED if case[0] == door):
        assert option.default is not MISSING
        for value in bad_values(option):
            with pytest.raises(FbidError) as caught:
                give(option.name, value)
            said = str(caught.value)
            called = getattr(option.kind, "what", "") or option.name
            assert called in said and shown(value) in said, said
            assert "Expected" in said or "Valid choices" in said, said
            assert len(said) < 1200 and "\n" not in said


def test_numbers_of_numpy_are_numbers():
    given = {
        "physics_hz": np.int64(1000),
        "control_hz": np.float32(500.0),
        "joint_noise": np.float32(0.25),
        "push_force": np.array([1.0, 2.0]),
        "push_interval": [np.float32(1.5), np.int64(3)],
        "solver_warm_start": np.bool_(False),
        "height_range": (np.float64(0.95), 1),
        "randomisation": {"mass": np.float32(0.5), "friction": np.array([0.5, 1.0])},
        "action_layer": "base_acceleration",
        "layer_options": {"friction": np.float64(0.5), "compensate_damping": np.bool_(True)},
    }
    config = EnvConfig.of(given)
    assert (config.physics_hz, config.control_hz, config.joint_noise) == (1000, 500, 0.25)
    assert (config.push_force, config.push_interval) == ((1.0, 2.0), (1.5, 3.0))
    assert config.solver_warm_start is False
    assert json.dumps(config.resolved())


@pytest.mark.parametrize("num_threads", [1, 300])
def test_episodes_of_many_robots_have_bounds_too(num_threads):
    config = EnvConfig.of({"episode_seconds": 1e5})
    with pytest.raises(FbidError, match="episode_seconds: 100000.0. Expected less: .* 300 such"):
        Chunks(config, 300, num_threads)


@pytest.fixture(scope="module")
def envs():
    made = begun(BIPED, 2, action_layer="torque")
    return made


def spoilt(state, name, value):
    return state | {name: np.full(np.shape(state[name]), value)}


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda s: "text", "Invalid state: 'text'"),
        (lambda s: {}, "Invalid state: .*among its arrays"),
        (lambda s: s | {"config": np.frombuffer(b"[1]", np.uint8)}, "state 'config'"),
        (lambda s: s | {"config": np.frombuffer(b"\xff", np.uint8)}, "state 'config'"),
        (lambda s: spoilt(s, "simulation.qpos", "a"), "state 'simulation.qpos'"),
        (lambda s: spoilt(s, "simulation.qpos", 1j), "state 'simulation.qpos'"),
        (lambda s: spoilt(s, "simulation.qpos", np.nan), "state 'simulation.qpos' is not finite"),
        (lambda s: spoilt(s, "tick", 0.5), "Invalid state 'tick'"),
        (lambda s: spoilt(s, "tick", -5), "Invalid state 'tick'"),
        (lambda s: spoilt(s, "generator", -1), "Invalid state 'generator'"),
        (lambda s: spoilt(s, "generator", np.uint64(2**63)), "Invalid state 'generator'"),
        (lambda s: spoilt(s, "progress.level", 10**6), "Invalid state 'progress.level'"),
        (lambda s: spoilt(s, "delay.ticks", 7), "Invalid state 'delay.ticks'"),
        (lambda s: s | {"tick": s["tick"][:1]}, r"state 'tick' has shape \(1,\)"),
    ],
)
def test_garbage_is_no_state_and_changes_nothing(envs, spoil, message):
    before = envs.chunks.state_dict()
    given = spoil(before)
    with pytest.raises(FbidError, match=message):
        envs.chunks.load_state_dict(given)
    assert_same(envs.chunks.state_dict(), before)


@pytest.mark.parametrize("options", ["text", 3, [], {"unknown": 1}, {1: 2}])
def test_options_of_reset(envs, options):
    scalar = gym.make(BIPED, action_layer="torque")
    for env in (scalar, envs):
        with pytest.raises(FbidError, match="options"):
            env.reset(options=options)
    for mask in (None, "ab", [1, 0], [True]):
        with pytest.raises(FbidError, match="reset_mask"):
            envs.reset(options={"reset_mask": mask})


def test_a_negative_seed():
    with pytest.raises(FbidError, match="Invalid seed: -1"):
        gym.make(BIPED, action_layer="torque").reset(seed=-1)
    with pytest.raises(FbidError, match="Invalid seed: -1"):
        fbid_gym.make_sb3(BIPED, 1, seed=-1)


def test_nothing_steps_before_reset_or_after_close():
    scalar = gym.make(BIPED, action_layer="torque")
    vector = gym.make_vec(BIPED, num_envs=1, action_layer="torque")
    sb3 = fbid_gym.make_sb3(BIPED, 1, action_layer="torque")
    with pytest.raises(gym.error.ResetNeeded):
        scalar.step(np.zeros(16))
    with pytest.raises(FbidError, match=r"call reset\(\)"):
        sb3.step(np.zeros((1, 16)))
    for env, action in ((scalar, np.zeros(16)), (vector, np.zeros((1, 16))), (sb3, [[0.0] * 16])):
        env.reset()
        env.close()
        for use in (env.reset, lambda env=env, action=action: env.step(action)):
            with pytest.raises(FbidError, match="closed: make"):
                use()


def test_without_stable_baselines3_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "stable_baselines3", None)
    monkeypatch.setitem(__import__("sys").modules, "stable_baselines3.common.vec_env", None)
    monkeypatch.delitem(__import__("sys").modules, "fbid_gym.envs.sb3", raising=False)
    with pytest.raises(FbidError, match=r"stable_baselines3.*pip install 'fbid_gym\[train\]'"):
        _ = fbid_gym.make_sb3
