"""The benchmark of layers: what it says of a known layer, and of files that cannot be run."""

from pathlib import Path

import numpy as np
import pytest

from eval import layers
from eval.layers import main
from eval.zero_actions.measures import scores_of
from fbid_gym import actions
from fbid_gym.envs.env_batch import EnvBatch
from fbid_gym.robots import load
from fbid_gym.runtime.config import EnvConfig
from train.environments import register, run_file
from train.runs.tables import read_rows

EXAMPLES = Path(__file__).resolve().parents[2] / "examples" / "layers"
TWIN = """
from fbid_gym.actions import LAYERS, register_layer
register_layer("twin", LAYERS["joint_position"])
"""
SHORT = ["--episodes", "3", "--seconds", "0.1", "--only", "robot=go1", "task=walk", "--against"]


pytestmark = pytest.mark.usefixtures("registries")


def test_a_twin_is_as_good_as_its_brother(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where a file has the rows: those of a file that has changed are measured anew."""
    file, out = tmp_path / "my_layer.py", tmp_path / "layers.html"
    file.write_text(TWIN)
    command = [str(file), *SHORT, "joint_position", "torque", "--out", str(out)]
    assert main(command) == 0
    told = capsys.readouterr().out
    assert "| twin |" in told and "| go1 | walk | 3/3" in told
    rows = read_rows(out.with_suffix(".csv"))
    twin, brother, still = (row["score_of_each"] for row in rows)
    assert twin == brother != still and len(twin.split()) == 3
    best, found = layers.standings(rows, ["joint_position", "torque"])
    equal = found["twin" if best == "joint_position" else "joint_position"]
    assert equal.score.value == found["joint_position"].score.value
    if best == "joint_position":
        assert equal.better.value == 0.5 and equal.p_value == 1.0
    page = out.read_text()
    assert "twin scores" in page and "eval.layers" in page and "<svg" in page
    out.with_suffix(".csv").write_text(out.with_suffix(".csv").read_text().replace(twin, "0 0 0"))
    actions.LAYERS.pop("twin")
    assert main(command) == 0  # all three rows are there
    assert read_rows(out.with_suffix(".csv"))[0]["score_of_each"] == "0 0 0"
    actions.LAYERS.pop("twin")
    file.write_text(TWIN + "# changed\n")
    assert main(command) == 0
    last = read_rows(out.with_suffix(".csv"))[-1]
    assert last["layer"] == "twin" and last["score_of_each"] == twin


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = 1", "registers no layer. Expected a call of register_layer."),
        ("import no_such_library", "cannot be run: ModuleNotFoundError: No module named 'no_such"),
        ("x = (", "cannot be run: SyntaxError: "),
        ("from fbid_gym.actions import register_layer\nregister_layer('torque', None)", "torque"),
        (
            "from fbid_gym.actions import register_layer\n"
            "def of(robot, control_hz, kind):\n    raise ZeroDivisionError('by\\nnothing')\n"
            "register_layer('mine', of)",
            "Layer 'mine' cannot be built for go1: ZeroDivisionError: by",
        ),
    ],
)
def test_a_file_that_cannot_be_used_is_one_line(
    text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "mine.py"
    file.write_text(text)
    assert main([str(file), *SHORT, "torque", "--out", str(tmp_path / "page.html")]) == 2
    told = capsys.readouterr().err
    assert told.startswith("error: ") and told.count("\n") == 1 and message in told
    assert list(tmp_path.glob("page*")) == []


def test_who_falls_earns_nothing_from_there_on() -> None:
    up = np.array([[True, True], [True, False], [True, False]])
    scores = scores_of({"up": up, "reward": np.full((3, 2), 0.5)}, steps=4)
    np.testing.assert_allclose(scores, [1.5 / 4, 0.5 / 4])


def test_a_file_may_be_registered_where_a_module_may(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(TWIN)
    register([str(tmp_path / "mine.py")])
    assert "twin" in actions.LAYERS


@pytest.mark.parametrize(("name", "library"), [("mink", "mink"), ("tsid", "tsid")])
def test_layers_of_others_stand_and_are_the_same_alone_as_beside_others(
    name: str, library: str
) -> None:
    pytest.importorskip(library, reason=f"{library}: see docs/layer_benchmark.md")
    run_file(EXAMPLES / f"{name}_layer.py")
    arguments = {"robot": load("go1"), "task": "balance", "action_layer": name}
    found = []
    for seeds in ([3, 4], [4]):
        batch = EnvBatch(EnvConfig.of(arguments | {"push_force": (0.0, 0.0)}), len(seeds))
        for env, seed in enumerate(seeds):
            batch.seed(env, np.random.default_rng(seed))
        batch.reset(np.arange(len(seeds)))
        for _ in range(20):
            step = batch.step(np.zeros((len(seeds), len(batch.action_names))))
        assert not step.terminated.any()
        found.append(step.observation[-1])
    np.testing.assert_allclose(found[0], found[1], atol=1e-6)
