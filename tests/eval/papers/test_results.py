"""Results of the papers' experiments are read as they were saved, or refused in one sentence."""

import jinja2
import numpy as np
import pytest

from eval.page import html
from eval.papers.experiment import Finding, Setting, curves, experiment, load, named, perform, row
from eval.papers.mistry2010.continuity import claim_continuity
from eval.papers.page import ExperimentSection, page, summary
from eval.papers.registry import Paper, experiments
from fbid_gym.errors import RunError, UnknownOptionError
from train.runs.files import read_json

FINDINGS = [
    Finding("hip | knee < 1", "0.1 rad", "0.2 rad", "missed", "at most 0.1 rad"),
    Finding("something of ours", "", "3.0"),
]
SECTION = """{% set target = "at most 0.1 rad" %}
{{ finding("hip | knee < 1", "0.1 rad", "%s rad" % share, target, share <= 0.1) }}
{% macro best_of() %}{{ best + 1 }}{% endmacro %}{{ finding("something of ours", "", best_of()) }}
<p>{{ kind }}<b>drawn</b></p>"""


@experiment(
    "A title",
    """What was
    done.""",
)
def example(setting):
    """Find a number."""
    for _ in setting.each(("alone", "both"), 0.5):
        pass
    kind = setting.pick("full<", "quick<")
    return {"best": 2.0, "none": float("inf"), "share": 0.2}, {"kind": kind}


@pytest.fixture(autouse=True)
def section(monkeypatch):
    """The example's template."""
    own, known = jinja2.DictLoader({"papers/example.html": SECTION}), html._TEMPLATES.loader
    monkeypatch.setattr(html._TEMPLATES, "loader", jinja2.ChoiceLoader([own, known]))


def test_a_result_is_read_as_it_was_saved(tmp_path):
    assert example.about == "What was done." and example.name == "example"
    assert load(example, tmp_path) is None
    perform(example, tmp_path, quick=True)
    run, body = load(example, tmp_path)
    assert run.findings == FINDINGS
    assert run.numbers == {"best": 2.0, "none": None, "share": 0.2}
    assert run.quick and run.seconds >= 0.0
    assert "<p>quick&lt;<b>drawn</b></p>" in body
    told = read_json(example.folder(tmp_path) / "progress.json")
    assert told == {"share": 0.25, "note": "both"}


@pytest.mark.parametrize("content", [b"", b"{}", b"[]", b"\x00" * 99, b'{"findings": 3}'])
def test_damaged_results_are_refused_in_one_sentence(content, tmp_path):
    perform(example, tmp_path, quick=False)
    (example.folder(tmp_path) / "numbers.json").write_bytes(content)
    with pytest.raises(RunError, match="example"):
        load(example, tmp_path)


def test_experiments_are_chosen_by_their_names_or_their_papers():
    every = experiments(())
    assert [len(some) for _, some in every] == [11, 5]
    for _, some in every:
        for one in some:
            assert one.title and one.about and one.minutes > 0.0
            assert one.command(True) == f"python -m eval.papers --only {one.name} --quick"
            html._TEMPLATES.get_template(f"papers/{one.name}.html")  # every filter exists
    ((_, some),) = experiments(("fig2_push", "garofalo2015"))
    assert some == every[1][1]
    with pytest.raises(UnknownOptionError, match="fig9.*fig2_push"):
        experiments(("fig9",))


def test_page_and_summary_hold_every_number_that_the_paper_has(tmp_path):
    perform(example, tmp_path, quick=True)
    own = ExperimentSection(example, *load(example, tmp_path), "python -m x")
    shown = own, ExperimentSection(example, None, "<b>", "python -m y")
    papers = [(Paper("A paper", "", ()), shown)]
    text = summary(papers)
    told = "hip \\| knee < 1 | 0.1 rad | **0.2 rad** | at most 0.1 rad (missed) |"
    assert f"| A title | {told}" in text
    assert "something of ours" not in text and "| A title | did not run to the end |" in text
    made = page(papers, "python -m eval.papers", 80.0, quick=False)
    assert "0 of 1 targets met" in made and "One experiment did not run to the end" in made
    assert "<b>drawn</b>" in made and "&lt;b&gt;" in made and "something of ours" in made


def test_an_experiment_of_a_paper_from_measuring_to_its_section(tmp_path):
    run = perform(claim_continuity, tmp_path, quick=True)
    assert [finding.verdict for finding in run.findings] == ["met", "shown", "shown"]
    assert load(claim_continuity, tmp_path)[1].count("<svg") == 4


def test_progress_goes_through_parts_within_parts(tmp_path):
    setting, told = Setting(path=tmp_path / "progress.json"), []
    for _ in setting.each(("first", "second"), 0.5):
        for _ in setting.each((("a", 1), ("b", 2))):
            told.append(read_json(tmp_path / "progress.json"))
    for _ in setting.each(("last",)):
        told.append(read_json(tmp_path / "progress.json"))
    assert [one["share"] for one in told] == [0.0, 0.125, 0.25, 0.375, 0.5]
    assert [told[k]["note"] for k in (1, 2, 4)] == ["first, b, 2", "second, a, 1", "last"]


def test_curves_are_of_rows_or_of_points():
    points = [{"law": law, "error": error} for law, error in (("b", 1), ("a", None), ("b", 2))]
    (_, colour, a), (_, _, b) = curves(points, "law", {"a": 3, "b": 1}, "error", 10.0)
    assert colour == 3 and np.isnan(a).all() and b.tolist() == [10.0, 20.0]
    ((_, _, whole),) = curves([{"law": "a", "error": [1, 2]}], "law", {"a": 0}, "error")
    assert whole.tolist() == [1.0, 2.0]
    assert named({"a": 0.5, "b": 1}, "{:.1f}".format) == "a: 0.5, b: 1.0"
    assert row(points, law="a") is points[1]
