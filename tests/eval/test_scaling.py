"""What a study says of robots that nobody learnt with: counted from rows as they are kept."""

from pathlib import Path

import numpy as np
import pytest

from eval import scaling
from eval.scaling import jobs, kept, played, table, unseen
from fbid_gym.errors import RunError
from train.runs.study import read_study
from train.runs.tables import to_csv

ENV = "fbid_gym/QuadrupedWalk-v0"
ARM = """
[[arms]]
name = "{}"
env = "fbid_gym/QuadrupedWalk-v0"
action_layer = "base_acceleration"
env_args = {{ observation = "body" }}
robots = {}
"""
TEXT = '[transfer]\nunseen = ["go1", "quadruped", "zoo:quadruped:1000"]\ngain = 4.0\n'
ROBOTS = ("go1", "quadruped", "zoo:quadruped:1000")
# Return of each on the three robots; the last row of an arm is another seed's.
RETURNS = {
    "one": [(900, 500, 300), (900, 700, 300)],
    "two": [(800, 800, 500), (800, 900, 400)],
    "zero, base_acceleration": [(700, 650, 350)],
    "proportional:4, base_acceleration": [(750, 840, 380)],
}


def rows() -> list[dict[str, object]]:
    found = []
    for name, seeds in RETURNS.items():
        arm = name if ", " not in name else ""
        for seed, returns in enumerate(seeds):
            for robot, value in zip(ROBOTS, returns, strict=True):
                own = {"arm": arm, "layer": "base acceleration", "seed": seed if arm else ""}
                own |= {"robot": robot, "mass": "3", "joints": "12", "feet": "4", "policy": name}
                did = {"episodes": "8", "return": str(value), "up": "0.5", "velocity_error": "0.1"}
                found.append(own | did)
    return found


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "bodies.toml"
    arms = ARM.format("one", '["go1"]') + ARM.format("two", '["zoo:quadruped:0-1"]')
    path.write_text(f"seeds = [0, 1]\n{TEXT}{arms}")
    return path


def test_who_learnt_with_a_robot_is_not_tested_by_it(path):
    study = read_study(path)
    found = played(study, rows())
    assert [one.name for one in found] == [*RETURNS]
    assert [one.bodies for one in found] == [1, 2, 0, 0]
    (robots,) = unseen(found)
    assert robots == ["quadruped", "zoo:quadruped:1000"]
    one = found[0]
    np.testing.assert_allclose(one.over("returned", robots), [400.0, 500.0])
    said = table(study, rows(), found).replace("\N{NO-BREAK SPACE}", " ")
    assert "| one | base acceleration | 1 | 2 | 450 (400 to 500) |" in said
    # Means over seeds are 600 and 300, and 850 and 450.
    assert "| 0 of 2, p = 1 | 0 of 2, p = 1 |" in said
    assert "| 2 of 2, p = 1 | 2 of 2, p = 1 |" in said  # 0.5 each, of four
    assert "| `go1` | 3 | 12 | (900, 50 %) | 800, 50 % |" in said
    assert scaling.drawn(found).count("<svg") == 3


def test_who_cannot_act_on_a_robot_is_compared_on_those_on_which_it_can(path):
    study = read_study(path)
    idle = ("two", "zoo:quadruped:1000")
    own = [r | {"episodes": "0"} if (r["arm"], r["robot"]) == idle else r for r in rows()]
    found = played(study, own)
    assert unseen(found) == [["quadruped", "zoo:quadruped:1000"], ["quadruped"]]
    said = table(study, own, found).replace("\N{NO-BREAK SPACE}", " ")
    _, first, second = said.split("robots that nobody learnt with and on which")
    assert first.startswith(" these arms") and "| two |" not in first
    assert "| one | base acceleration | 1 | 2 | 450 (400 to 500) |" in first
    assert "| two | base acceleration | 2 | 2 | 850 (800 to 900) |" in second
    assert "| one | base acceleration | 1 | 2 | 600 (500 to 700) |" in second
    assert "| 300, 50 % | cannot act |" in second
    assert scaling.drawn(found).count("<svg") == 5  # two panels for each set, and the sheet


def test_what_is_kept_is_of_the_robots_and_policies_of_today(path, tmp_path, monkeypatch):
    """Another list of robots, or a policy that was trained on, is played anew."""
    monkeypatch.setattr(scaling, "is_finished", lambda config: True)
    digests = {"value": "a"}
    monkeypatch.setattr(scaling, "policy_digest", lambda folder: digests["value"])
    study = read_study(path, tmp_path / "runs")
    asked = list(jobs(study))
    assert len(asked) == 5  # two arms of two seeds, and their layer's laws
    (laws,) = (job for job in asked if "laws" in job.command)
    assert laws.command[laws.command.index("--gain") + 1] == "4.0"
    for job in asked:
        out = Path(job.command[-1])
        out.parent.mkdir(exist_ok=True, parents=True)
        out.write_text(to_csv(("robot", "episodes"), [{"robot": "go1", "episodes": 8}]))
    assert not list(jobs(study)) and len(kept(study)) == 5
    digests["value"] = "b"
    assert len(list(jobs(study))) == 4
    digests["value"] = "a"
    path.write_text(path.read_text().replace("zoo:quadruped:1000", "zoo:quadruped:1001"))
    assert len(list(jobs(read_study(path, tmp_path / "runs")))) == 5


def test_a_study_without_unseen_robots_is_refused(path, capsys):
    path.write_text(path.read_text().replace(TEXT, ""))
    with pytest.raises(RunError, match="has no \\[transfer\\]"):
        scaling.main(scaling.ScalingConfig(path))
