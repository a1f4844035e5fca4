"""Jobs on a cluster of several machines, one of which is lost."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import pytest

from fbid_gym.errors import RunError
from train.runs.cluster import cluster

ROOT = Path(__file__).parents[3]
with_ray = pytest.mark.skipif(
    importlib.util.find_spec("ray") is None, reason="Ray is not installed: pip install -e .[ray]"
)


@pytest.mark.slow
@with_ray
def test_jobs_of_a_lost_machine_go_on_elsewhere(tmp_path):
    drill = [sys.executable, "-m", "tests.train.runs.cluster_drill", str(tmp_path)]
    done = subprocess.run(drill, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[-3000:]
    found = json.loads((tmp_path / "found.json").read_text())
    assert found["cores"] == 2 and found["failed"] == []
    assert found["counts"] == ["30", "30"]
    assert found["begun"] == [1, 2]  # one of the two began again, and went on
    assert found["saved"]  # what is stopped may save what it has
    assert found["status"] == 3
    assert "cannot write to" in found["blind"] and "/nowhere/python" in found["blind"]


@with_ray
@pytest.mark.filterwarnings("ignore")
def test_an_address_that_nobody_answers_is_one_error(tmp_path):
    with pytest.raises(RunError, match="No Ray cluster answers at '127.0.0.1:1'"):
        with cluster("127.0.0.1:1", tmp_path):
            pass


def test_without_ray_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(RunError, match=r"pip install -e .\[ray\]"):
        with cluster("auto", tmp_path):
            pass
