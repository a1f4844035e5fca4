import tyro

from eval.compare import CompareConfig
from eval.demo import DemoConfig, compared, film_zero_action, trainings
from train.recipes import config_for


def test_the_recipe_of_the_environment_says_how_to_train():
    for env in ("fbid_gym/QuadrupedWalk-v0", "fbid_gym/BipedBalance-v0"):
        for (layer, _), training in trainings(DemoConfig(env=env)).items():
            assert training.ppo == config_for(env, layer).ppo
            assert training.num_envs == config_for(env, layer).num_envs


def test_harder_pushes_are_compared_where_those_of_training_make_nobody_fall(tmp_path):
    def settings(env):
        words = compared(DemoConfig(out=tmp_path, env=env, video_seconds=0.0), tmp_path / "r.html")
        return tyro.cli(CompareConfig, args=words)

    walk, balance = settings("fbid_gym/QuadrupedWalk-v0"), settings("fbid_gym/BipedBalance-v0")
    assert max(walk.pushes) > max(balance.pushes)
    assert walk.video_push > 0.4 and balance.video_push is None  # that of training
    assert walk.video_seconds == balance.video_seconds == 0.0


def test_the_zero_action_is_filmed_before_any_training(tmp_path):
    config = DemoConfig(out=tmp_path / "new", video_seconds=0.2)
    path = film_zero_action(config)
    assert path.read_bytes()[4:8] == b"ftyp"
    assert [*path.parent.iterdir()] == [path]
