import pytest

from fbid_gym.errors import RunError
from train.runs.tables import TableWriter, check_kept, read_rows


def test_rows_after_the_checkpoint_are_cut_even_a_half_one(tmp_path):
    path = tmp_path / "log.csv"
    log = TableWriter(path, ("steps", "value"), None)
    log.append({"steps": 1, "value": 0.1 + 0.2})
    size = log.size
    log.append({"steps": 2, "value": 9.0})
    log.close()
    with path.open("a") as file:
        file.write("3,1.2")
    check_kept(path, ("steps", "value"), size)
    log = TableWriter(path, ("steps", "value"), size)
    log.append({"value": float("nan"), "steps": 2})
    log.sync()
    log.close()
    rows = [(int(row["steps"]), row["value"]) for row in read_rows(path)]
    assert rows == [(1, repr(0.1 + 0.2)), (2, "nan")]


@pytest.mark.parametrize("content", [None, "", "steps,value\n", "other,value\n1,2\n3,4\n5,6\n"])
def test_tables_shorter_than_the_checkpoint_says(tmp_path, content):
    path = tmp_path / "log.csv"
    if content is not None:
        path.write_text(content)
    with pytest.raises(RunError, match=r"log\.csv: has \d+ bytes\. Expected at least the 16"):
        check_kept(path, ("steps", "value"), 16)


def test_rows_are_read_while_they_are_written(tmp_path):
    path = tmp_path / "log.csv"
    assert read_rows(path) == []
    path.write_text("steps,fps\n2048,1.0\n40")
    assert read_rows(path) == [{"steps": "2048", "fps": "1.0"}]
