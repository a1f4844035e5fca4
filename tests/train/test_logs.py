import csv

import pytest
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

from fbid_gym.errors import RunError
from train.logs import CsvLog, TensorBoardLog


def test_rows_after_the_checkpoint_are_cut_even_a_half_one(tmp_path):
    path = tmp_path / "log.csv"
    log = CsvLog(path, ("steps", "value"), None)
    log.append({"steps": 1, "value": 0.1 + 0.2})
    size = log.size
    log.append({"steps": 2, "value": 9.0})
    log.close()
    with path.open("a") as file:
        file.write("3,1.2")
    log = CsvLog(path, ("steps", "value"), size)
    log.append({"value": float("nan"), "steps": 2})
    log.sync()
    log.close()
    rows = list(csv.DictReader(path.read_text().splitlines()))
    assert [(int(r["steps"]), r["value"]) for r in rows] == [(1, repr(0.1 + 0.2)), (2, "nan")]


@pytest.mark.parametrize("content", [None, "", "steps,value\n", "other,value\n1,2\n3,4\n5,6\n"])
def test_logs_shorter_than_the_checkpoint_says(tmp_path, content):
    path = tmp_path / "log.csv"
    if content is not None:
        path.write_text(content)
    with pytest.raises(RunError, match=r"log\.csv: has \d+ bytes\. Expected at least the 16"):
        CsvLog(path, ("steps", "value"), 16)


def test_tensorboard_hides_what_is_taken_again(tmp_path):
    log = TensorBoardLog(tmp_path, 0)
    for steps in (1, 2, 3, 4):
        log.append("train", {"steps": steps, "value": float(steps)})
    log.close()
    log = TensorBoardLog(tmp_path, 2)
    for steps in (3, 4, 5):
        log.append("train", {"steps": steps, "value": 10.0 * steps})
    log.close()
    events = EventAccumulator(str(tmp_path))
    events.Reload()
    found = [(e.step, e.value) for e in events.Scalars("train/value")]
    assert found == [(1, 1.0), (2, 2.0), (3, 30.0), (4, 40.0), (5, 50.0)]
