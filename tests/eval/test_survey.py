"""The survey trains on every environment, and what it draws is what was evaluated."""

import csv
import io
from xml.etree import ElementTree

from eval.survey import LAYERS, SurveyConfig, curves, drawn, trainings
from fbid_gym.actions import LAYERS as ALL_LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.tasks import TASKS
from train.runs.folder import RunFolder


def test_every_task_is_trained_through_layers_that_exist():
    assert LAYERS.keys() == TASKS.keys()
    assert {layer for layers in LAYERS.values() for layer in layers} <= ALL_LAYERS.keys()


def test_every_environment_is_trained_on_by_its_own_run(tmp_path):
    config = SurveyConfig(out=tmp_path, envs=tuple(ENVIRONMENTS), total_steps=80_000, evaluations=4)
    every = trainings(config)
    assert {training.env for training in every} == ENVIRONMENTS.keys()
    assert len({training.folder for training in every}) == len(every)
    for training in every:
        assert training.action_layer in LAYERS[ENVIRONMENTS[training.env]["task"]]
        assert (training.total_steps, training.eval.every) == (80_000, 20_000)


def test_curves_hold_every_evaluation(tmp_path):
    first, second, *_ = trainings(SurveyConfig(out=tmp_path))
    for run, height in ((first, 10.0), (second, 20.0)):
        run.folder.mkdir()
        RunFolder.of(run.folder).evaluations.write_text(
            "steps,episodes,return_mean,return_std,return_q25,return_q75,length_mean,survival\n"
            f"0,8,{height},1,{height - 1},{height + 1},50,0.5\n"
            f"1000,8,{2 * height},1,{height - 1},{height + 1},50,1.0\n"
        )
        RunFolder.of(run.folder).progress.write_text(
            f"steps,return_mean\n400,nan\n800,{height / 2}\n1200,{height}\n"
        )
    rows = list(csv.DictReader(io.StringIO(curves([first, second]))))
    assert [(row["env"], row["layer"], float(row["return_mean"])) for row in rows] == [
        *((first.env, first.action_layer, 10.0), (first.env, first.action_layer, 20.0)),
        *((second.env, second.action_layer, 20.0), (second.env, second.action_layer, 40.0)),
    ]
    assert [row["return_exploring"] for row in rows] == ["", "5.0", "", "10.0"]
    picture = ElementTree.fromstring(drawn([first, second]))
    assert len(picture.findall("{http://www.w3.org/2000/svg}svg")) == len({first.env, second.env})
