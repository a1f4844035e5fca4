import io

from rich.console import Console

from eval.demo import DemoConfig, table, trainings
from train.runs.folder import RunFolder


def test_trainings_differ_in_layer_and_seed(tmp_path):
    config = DemoConfig(out=tmp_path, total_steps=80_000, evaluations=8, episodes=5)
    every = trainings(config)
    assert list(every) == [
        *(("base_acceleration", 0), ("base_acceleration", 1)),
        *(("joint_position", 0), ("joint_position", 1)),
    ]
    for key, training in every.items():
        assert (training.action_layer, training.seed) == key
        assert training.folder.parent == tmp_path
        assert training.total_steps == 80_000 and training.num_threads == 1
        assert (training.eval.every, training.eval.episodes) == (10_000, 5)
    assert len({training.folder for training in every.values()}) == 4
    assert len({(training.ppo, training.eval) for training in every.values()}) == 1


def test_the_table_says_what_the_runs_came_to(tmp_path):
    every = trainings(DemoConfig(out=tmp_path, layers=("base_acceleration",), seeds=(7,)))
    (training,) = every.values()
    training.folder.mkdir()
    RunFolder.of(training.folder).evaluations.write_text(
        "steps,wall_seconds,return_mean,survival\n0,0,20,0\n2048,60.0,50,0.5\n4096,120.0,40,0.25\n"
    )
    console = Console(file=io.StringIO(), width=100)
    console.print(table(every))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    for part in ("base_acceleration", "7", "20", "40", "25%", "50", "2.0"):
        assert part in text
