"""The survey's commands are trainings, and what it draws is what they evaluated."""

import csv
import io
from xml.etree import ElementTree

from fbid_gym.actions import LAYERS as ALL_LAYERS
from fbid_gym.envs import ENVIRONMENTS
from fbid_gym.tasks import TASKS
from train.runs.config import parse
from train.survey import LAYERS, SurveyConfig, curves, drawn, runs


def test_every_task_is_trained_through_layers_that_exist():
    assert LAYERS.keys() == TASKS.keys()
    assert {layer for layers in LAYERS.values() for layer in layers} <= ALL_LAYERS.keys()


def test_every_environment_is_trained_on_by_its_own_run(tmp_path):
    config = SurveyConfig(out=tmp_path, envs=tuple(ENVIRONMENTS), total_steps=80_000, evaluations=4)
    every = runs(config)
    trainings = [parse(list(run.job.command[3:])) for run in every]
    assert {training.env for training in trainings} == ENVIRONMENTS.keys()
    assert len({training.folder for training in trainings}) == len(every)
    for run, training in zip(every, trainings, strict=True):
        assert (training.env, training.action_layer) == (run.env, run.layer)
        assert (training.total_steps, training.eval.every) == (80_000, 20_000)


def test_curves_hold_every_evaluation(tmp_path):
    first, second, *_ = runs(SurveyConfig(out=tmp_path))
    for run, height in ((first, 10.0), (second, 20.0)):
        run.job.folder.mkdir()
        (run.job.folder / "evaluations.csv").write_text(
            "steps,episodes,return_mean,return_std,return_q25,return_q75,length_mean,survival\n"
            f"0,8,{height},1,{height - 1},{height + 1},50,0.5\n"
            f"1000,8,{2 * height},1,{height - 1},{height + 1},50,1.0\n"
        )
        (run.job.folder / "progress.csv").write_text(
            f"steps,return_mean\n400,nan\n800,{height / 2}\n1200,{height}\n"
        )
    rows = list(csv.DictReader(io.StringIO(curves([first, second], 0))))
    assert [(row["env"], row["layer"], float(row["return_mean"])) for row in rows] == [
        *((first.env, first.layer, 10.0), (first.env, first.layer, 20.0)),
        *((second.env, second.layer, 20.0), (second.env, second.layer, 40.0)),
    ]
    assert [row["return_exploring"] for row in rows] == ["", "5.0", "", "10.0"]
    picture = ElementTree.fromstring(drawn([first, second]))
    assert len(picture.findall("{http://www.w3.org/2000/svg}svg")) == len({first.env, second.env})
