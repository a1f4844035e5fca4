"""The search for inputs that break something: a short one, and that it finds and keeps what fails.

Arguments and kills are left to `make fuzz`: some take all the time there is. Trainings that are
killed have tests of their own.
"""

from types import SimpleNamespace

import pytest
from hypothesis import strategies as st

from eval.fuzz.__main__ import SUBJECTS, FuzzConfig, main
from eval.fuzz.search import search


@pytest.mark.parametrize("name", ["laws", "ticks", "models", "bundles", "commands"])
def test_a_short_search_finds_nothing(name, tmp_path):
    outcome = search(name, SUBJECTS[name], seed=0, seconds=1.5, folder=tmp_path)
    assert outcome.tried > 0
    assert outcome.failures == [], [path.read_text() for path in outcome.failures]


def _faults(case):
    if case["x"] > 100:
        raise ZeroDivisionError("too large")
    if case["x"] < -1000:
        yield "too small"


def test_a_failure_is_shrunk_kept_and_repeated(tmp_path, monkeypatch, capsys):
    cases = st.fixed_dictionaries({"x": st.integers(-1000, 10**6)})
    subject = SimpleNamespace(
        cases=lambda: cases, faults=_faults, UNIT="digits", amount=lambda case: len(str(case["x"]))
    )
    outcome = search("planted", subject, seed=0, seconds=0.3, folder=tmp_path)
    (kept,) = outcome.failures
    assert '"x": 101' in kept.read_text()
    assert not list(tmp_path.glob("*trying*"))
    monkeypatch.setitem(SUBJECTS, "planted", subject)
    assert main(FuzzConfig(case=kept)) == 1
    assert "ZeroDivisionError: too large" in capsys.readouterr().out
