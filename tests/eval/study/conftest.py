"""The small study, of which nothing has begun."""

import pytest

from tests.eval.study.small import STUDY
from train.runs.study import read_study


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text(STUDY)
    return read_study(path, tmp_path / "out")
