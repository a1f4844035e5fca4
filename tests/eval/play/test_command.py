"""The command line: bad input is one line, and nothing listens."""

import socket
from pathlib import Path

import pytest

from eval.play.__main__ import main

pytest.importorskip("viser", reason="the live page is not installed: make play")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["fbid_gym/Nobody-v0"], "Unknown environment 'fbid_gym/Nobody-v0'"),
        (["os:fbid_gym/QuadrupedWalk-v0"], "Unknown environment"),
        (["--action-layer", "magic"], "Unknown action layer 'magic'"),
        (["--beside", "magic"], "Unknown beside 'magic'"),
        (["--policy", "runs/nobody"], "runs/nobody"),
        (["--robot", "nobody"], "Unknown robot 'nobody'"),
        (["--feet", "left"], "none without --robot"),
        (["--env-args", "{"], "Invalid env_args"),
        (["--env-args", '{"episode_seconds": 3}'], "the page's own"),
        (["--settings", "ahead=9"], "Invalid ahead"),
        (["--settings", "__import__('os')"], "Invalid link"),
        (["--port", "-1"], "Invalid port"),
        (["--port", "70000"], "Invalid port"),
        (["--host", "256.1.1.1"], "Invalid host and port"),
        (["--host", "a" * 64], "Invalid host and port"),
        (["--measure", "0"], "Invalid measure"),
    ],
)
def test_bad_input_is_one_line(
    arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert words in said.err and said.err.count("\n") == 1 and said.out == ""


def test_a_port_in_use_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        assert main(["--port", str(taken.getsockname()[1])]) == 2
    assert "Invalid host and port" in capsys.readouterr().err


def test_it_measures_what_it_takes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--measure", "1", "--port", "0"]) == 0
    said = capsys.readouterr()
    assert "of a core" in said.out and "with one viewer" in said.out
