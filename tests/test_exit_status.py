"""How commands end."""

import os
import subprocess
import sys

import pytest

_COMMAND = """
import sys
from fbid_gym.exit_status import exit_status
def work():
    {}
sys.exit(exit_status(work))
"""


def _run(work: str, unread: bool, *options: str) -> tuple[int, str]:
    """Exit status and standard error of a command whose output nobody reads, if `unread`."""
    reader, writer = os.pipe()
    if unread:
        os.close(reader)
    command = [sys.executable, *options, "-c", _COMMAND.format(work)]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    for end in (writer,) if unread else (writer, reader):
        os.close(end)
    return done.returncode, done.stderr


@pytest.mark.parametrize("options", [(), ("-u",)], ids=["buffered", "unbuffered"])
@pytest.mark.parametrize("lines", [1, 10_000])
def test_output_that_nobody_reads_is_no_error(lines, options):
    """As in `command | head -1`: silent, with the status that a shell gives to it."""
    work = f"for _ in range({lines}): print('a line')"
    assert _run(work, True, *options) == (141, "")


def test_help_that_nobody_reads_to_its_end_is_no_error():
    """The parser ends the command itself."""
    assert _run("print('help'); sys.exit(0)", True) == (141, "")
    assert _run("print('help'); sys.exit(0)", False) == (0, "")


def test_another_broken_pipe_is_an_error():
    """Of a process of ours, say: not to be taken for the end of interest."""
    assert _run("raise BrokenPipeError(32, 'Broken pipe')", False) == (2, "error: Broken pipe.\n")


@pytest.mark.parametrize(
    ("work", "status", "said"),
    [
        ("return None", 0, ""),
        ("return 1", 1, ""),
        ("raise KeyboardInterrupt", 130, ""),
        ("open('/nonexistent/file')", 2, "error: /nonexistent/file: No such file or directory.\n"),
    ],
)
def test_each_end_has_its_status(work, status, said):
    assert _run(work, False) == (status, said)
