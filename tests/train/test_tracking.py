"""`--track`, with somebody who stands in for Weights & Biases: nothing is sent from a test."""

import sys
from types import SimpleNamespace

import pytest
import stand_in

from fbid_gym.errors import FbidError
from train.training import main


def test_it_is_refused_before_anything_is_written_where_wandb_is_missing(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(FbidError, match=r"--track needs wandb.*pip install 'fbid_gym\[track\]'"):
        main(stand_in.config(tmp_path / "run", track=True), stand_in.make)
    assert not (tmp_path / "run" / "config.json").exists()


def test_what_is_tracked_is_what_tensorboard_and_the_tables_have(tmp_path, monkeypatch):
    rows, ended = [], []
    run = SimpleNamespace(
        log=lambda row, step: rows.append((step, row)), finish=lambda: ended.append(len(rows))
    )
    told = {}
    fake = SimpleNamespace(init=lambda **given: told.update(given) or run, Error=RuntimeError)
    monkeypatch.setitem(sys.modules, "wandb", fake)
    monkeypatch.delenv("WANDB_PROJECT", raising=False)
    main(stand_in.config(tmp_path / "run", track=True), stand_in.make)
    assert (told["project"], told["name"], told["config"]["seed"]) == ("fbid_gym", "run", 3)
    lines = (tmp_path / "run" / "progress.csv").read_text().splitlines()
    steps = [int(line.partition(",")[0]) for line in lines[1:]]
    assert [step for step, row in rows if "train/return_mean" in row] == steps
    assert any("eval/return_mean" in row for _, row in rows) and ended == [len(rows)]
    assert "track" not in told["config"]
