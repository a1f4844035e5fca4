"""The small study, of which nothing has begun."""

import pytest

from tests.eval.study.small import written


@pytest.fixture
def study(tmp_path):
    return written(tmp_path)
