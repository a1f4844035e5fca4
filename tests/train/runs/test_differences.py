from pathlib import Path

from train.runs.config import EvaluationConfig, PPOConfig, SACConfig, TrainConfig
from train.runs.differences import (
    differences,
    in_words,
    run_differences,
    training_differences,
    training_settings,
)


def test_what_makes_another_run():
    stored = TrainConfig().to_json()
    own = {"total_steps": 5, "checkpoint_every": 0, "num_threads": 7}
    own |= {"torch_threads": stored["torch_threads"], "out": Path("x"), "overwrite": True}
    same = TrainConfig(**own)
    assert run_differences(stored, same.to_json()) == []
    wide, said = {"env": "fbid_gym/QuadrupedWalk-v1"}, {"robot": "go1", "push_weights": [0.0, 1.2]}
    given = TrainConfig(**wide, env_args=said).to_json()
    assert run_differences(TrainConfig(**wide).to_json(), given) == []
    other = TrainConfig(seed=4, env_args={"push_force": [1, 2]}, ppo=PPOConfig(gamma=0.9))
    assert [str(one) for one in run_differences(stored, other.to_json())] == [
        "env_args.push_force [1, 2] instead of unset",
        "ppo.gamma 0.9 instead of 0.99",
        "seed 4 instead of 0",
    ]
    other = TrainConfig(torch_threads=stored["torch_threads"] + 1)
    assert [its.name for its in run_differences(stored, other.to_json())] == ["torch_threads"]
    other = TrainConfig(layer_options={"contact_limits": "none"})
    words = 'layer_options.contact_limits "none" instead of unset'
    assert in_words(run_differences(stored, other.to_json())) == words


def test_what_makes_another_training_for_a_comparison():
    one = training_settings(TrainConfig().to_json())
    own = {"action_layer": "joint_position", "layer_options": {"scale": 0.2}, "seed": 4}
    own |= {"num_threads": 7, "torch_threads": 2, "checkpoint_every": 0}
    alike = TrainConfig(**own, eval=EvaluationConfig(every=5))
    assert training_settings(alike.to_json()) == one
    other = TrainConfig(total_steps=5, ppo=PPOConfig(gamma=0.9))
    names = [its.name for its in differences(one, training_settings(other.to_json()))]
    assert names == ["ppo.gamma", "total_steps"]


def test_a_run_of_before_there_was_a_choice_is_not_one_of_today():
    today = TrainConfig().to_json()
    before = {name: value for name, value in today.items() if name != "stagger"}
    assert in_words(run_differences(before, today)) == "stagger true instead of false"
    assert run_differences(before, TrainConfig(stagger=False).to_json()) == []
    assert [its.name for its in training_differences(before, today)] == ["stagger"]


def test_another_algorithm_is_a_difference_of_its_own():
    """Its hyperparameters are not set against those of the other; of before there was one, PPO."""
    ppo, sac = TrainConfig(seed=1).to_json(), TrainConfig(algorithm="sac").to_json()
    words = 'algorithm "sac" instead of "ppo"'
    assert in_words(run_differences(ppo, sac)) == f"{words}, seed 0 instead of 1"
    assert in_words(training_differences(ppo, sac)) == words
    other = TrainConfig(algorithm="sac", sac=SACConfig(tau=0.5)).to_json()
    assert in_words(training_differences(sac, other)) == "sac.tau 0.5 instead of 0.005"
    del ppo["algorithm"]
    assert run_differences(ppo, TrainConfig(seed=1).to_json()) == []
