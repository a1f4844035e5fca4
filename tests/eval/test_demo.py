import io

import tyro
from rich.console import Console

from eval.compare import CompareConfig
from eval.demo import DemoConfig, compared, film_zero_action, table, trainings
from train.recipes import config_for
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
        "steps,wall_seconds,return_mean,survival,velocity_error\n"
        "0,0,20,0,0.5\n2048,60.0,50,0.5,0.4\n4096,120.0,40,0.25,0.321\n"
    )
    console = Console(file=io.StringIO(), width=100)
    console.print(table(every))
    text = console.file.getvalue()  # type: ignore[attr-defined]
    for part in ("base_acceleration", "7", "20", "40", "25%", "50", "2.0", "0.321 m/s"):
        assert part in text


def test_the_recipe_of_the_environment_says_how_to_train():
    for env in ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedBalance-v0"):
        for (layer, _), training in trainings(DemoConfig(env=env)).items():
            assert training.ppo == config_for(env, layer).ppo
            assert training.num_envs == config_for(env, layer).num_envs


def test_harder_pushes_are_compared_where_those_of_training_make_nobody_fall(tmp_path):
    def settings(env):
        words = compared(DemoConfig(out=tmp_path, env=env, video_seconds=0.0), tmp_path / "r.html")
        return tyro.cli(CompareConfig, args=words).settings

    walk, balance = settings("fbid_gym/QuadrupedWalk-v0"), settings("fbid_gym/BipedBalance-v0")
    assert max(walk.sweep) > max(balance.sweep)
    assert walk.video_seconds == balance.video_seconds == 0.0


def test_the_zero_action_is_filmed_before_any_training(tmp_path):
    config = DemoConfig(out=tmp_path / "new", video_seconds=0.2)
    path = film_zero_action(config)
    assert path.read_bytes()[4:8] == b"ftyp"
    assert [*path.parent.iterdir()] == [path]
