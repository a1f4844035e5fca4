import io
import os

import pytest
from rich.console import Console

from train.demo import DemoConfig, jobs, table
from train.parallel import train
from train.runs.config import parse


def test_commands_are_trainings_that_differ_in_layer_and_seed(tmp_path):
    config = DemoConfig(out=tmp_path, total_steps=80_000, evaluations=8, episodes=5)
    trainings = [parse(list(job.command[3:])) for job in jobs(config)]
    assert [(t.action_layer, t.seed) for t in trainings] == [
        *(("base_acceleration", 0), ("base_acceleration", 1)),
        *(("joint_position", 0), ("joint_position", 1)),
    ]
    for training, job in zip(trainings, jobs(config), strict=True):
        assert training.folder == job.folder and job.folder.parent == tmp_path
        assert training.total_steps == 80_000 and training.num_threads == 1
        assert (training.eval.every, training.eval.episodes) == (10_000, 5)
    assert len({t.folder for t in trainings}) == 4
    assert len({(t.ppo, t.eval) for t in trainings}) == 1


def test_progress_is_read_while_it_is_written(tmp_path):
    (job, *_) = jobs(DemoConfig(out=tmp_path))
    assert job.steps == 0 and job.result == ""
    job.folder.mkdir()
    (job.folder / "progress.csv").write_text("steps,fps\n2048,1.0\n40")
    (job.folder / "evaluations.csv").write_text(
        "steps,wall_seconds,return_mean,survival\n0,0,20,0\n2048,60.0,50,0.5\n4096,120.0,40,0.25\n"
    )
    assert job.steps == 2048
    assert job.result == "  return 40, survival 25%"
    console = Console(file=io.StringIO(), width=100)
    console.print(table([job]))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert all(part in text for part in ("base_acceleration", "20", "40", "25%", "50", "2.0"))


def test_failed_training_is_reported_and_stops_the_demo(tmp_path, monkeypatch):
    root = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    monkeypatch.setenv("PYTHONPATH", root)
    console = Console(file=io.StringIO(), width=200)
    (job,) = jobs(DemoConfig(out=tmp_path, layers=("flying",), seeds=(0,)))
    assert not train([job], 2, console)
    text = console.file.getvalue()  # type: ignore[attr-defined]
    assert "flying, seed 0 failed with status 2" in text
    assert "Unknown action layer 'flying'. Valid choices:" in text


@pytest.mark.slow
def test_trainings_finish_side_by_side(tmp_path):
    config = DemoConfig(
        out=tmp_path, layers=("joint_position",), total_steps=4096, evaluations=1, episodes=2
    )
    assert train(jobs(config), 2, Console(file=io.StringIO()))
    for job in jobs(config):
        assert job.steps == 4096
        assert [int(row["steps"]) for row in job.rows("evaluations.csv")] == [0, 4096]
