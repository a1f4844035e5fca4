"""The command line: bad input is one line, and nothing listens."""

import socket

import pytest

from eval.play.__main__ import main

pytest.importorskip("viser", reason="the live page is not installed: make play")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fbid_gym/Nobody-v0"], "Unknown environment 'fbid_gym/Nobody-v0'"),
        (["--action-layer", "magic"], "Unknown action layer 'magic'"),
        (["--policy", "runs/nobody"], "runs/nobody"),
        (["--env-args", '{"episode_seconds": 3}'], "the page's own"),
        (["--settings", "__import__('os')"], "Invalid link"),
        (["--port", "-1"], "Invalid port"),
        (["--host", "a" * 64], "Invalid host and port"),
        (["--measure", "0"], "Invalid measure"),
    ],
)
def test_bad_input_is_one_line(arguments, words, capsys):
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert words in said.err and said.err.count("\n") == 1 and said.out == ""


def test_a_port_in_use_is_said(capsys):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert main(["--port", str(taken.getsockname()[1])]) == 2
    assert "Invalid host and port" in capsys.readouterr().err


def test_it_measures_what_it_takes(tmp_path, capsys):
    assert main(["--measure", "1", "--port", "0"]) == 0
    said = capsys.readouterr()
    assert "of a core" in said.out and "with one viewer" in said.out
