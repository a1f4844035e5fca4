"""What is compiled is kept on disk, found again, and never used once any of its sources changed."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

KERNEL = """
import numpy as np
from fbid_gym.compiled import kernel
from probe.inner import factor

@kernel
def scale(x: np.ndarray) -> None:
    for i in range(len(x)):
        x[i] *= factor()
"""
INNER = """
from fbid_gym.compiled import compiled

@compiled
def factor() -> float:
    return {factor}
"""
START = f"""
import sys
from pathlib import Path
from types import ModuleType
import numpy as np
# Without the environments and all that they import.
sys.modules["fbid_gym"] = package = ModuleType("fbid_gym")
package.__path__ = [{str(Path(__file__).parents[1] / "fbid_gym")!r}]
from fbid_gym import compile_cache, compiled
compile_cache._MOMENT = compile_cache.NEWS._next = float(sys.argv[1])
compiled._OURS, compiled._PLACES = "probe", compile_cache.folders(Path("probe").resolve())
from probe.outer import scale
"""
RUN = """
x = np.ones(3)
scale(x)
print(x[0], sum(scale.entry.stats.cache_hits.values()))
"""
COLD, WARM = ["2.0", "0"], ["2.0", "1"]
NEVER = "1e9"
"""When to say that something is compiled, s."""


@pytest.fixture
def probe(tmp_path):
    """A package with a kernel, which calls a function of another file."""
    folder = tmp_path / "probe"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "outer.py").write_text(KERNEL)
    (folder / "inner.py").write_text(INNER.format(factor=2.0))
    return folder


def start(
    probe: Path, *arguments: str, program: str = RUN, **environment: str
) -> subprocess.Popen[str]:
    """Start a process that uses the kernel."""
    own = {"NUMBA_CACHE_DIR": "", "XDG_CACHE_HOME": str(probe.parent / "cache")}
    return subprocess.Popen(
        [sys.executable, "-c", START + program, *(arguments or [NEVER])],
        cwd=probe.parent,
        env=os.environ | own | environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def end(process: subprocess.Popen[str]) -> tuple[list[str], list[str]]:
    """What a process computes, whether it found the kernel on disk, and what it says."""
    said, complaints = process.communicate(timeout=100)
    assert process.returncode == 0, complaints
    return said.split(), complaints.splitlines()


def run(probe: Path, *arguments: str, **environment: str) -> tuple[list[str], list[str]]:
    """Start a process, and wait for its end."""
    return end(start(probe, *arguments, **environment))


def forbid(folder: Path) -> str:
    """Make a folder that nobody can write to, the superuser included, and return its name."""
    folder.write_text("a file")
    return str(folder)


@pytest.mark.slow
def test_kernels_are_kept_until_what_they_call_changes(probe):
    assert run(probe) == (COLD, [])
    assert run(probe) == (WARM, [])
    # Another file, of the same size: the kernel's own is as it was.
    (probe / "inner.py").write_text(INNER.format(factor=3.0))
    assert run(probe) == (["3.0", "0"], [])
    assert run(probe) == (["3.0", "1"], [])
    assert not (probe.parent / "cache").exists()
    # What an installation brings is read where nothing can be written.
    assert run(probe, XDG_CACHE_HOME=forbid(probe.parent / "cache")) == (["3.0", "1"], [])
    # A folder that is named is the only one.
    assert run(probe, NUMBA_CACHE_DIR=str(probe.parent / "named")) == (["3.0", "0"], [])


def test_an_installation_that_cannot_be_written_keeps_them_in_the_users_cache(probe):
    forbid(probe / "__pycache__")
    assert run(probe) == (COLD, [])
    assert run(probe) == (WARM, [])
    assert len(list((probe.parent / "cache" / "fbid_gym").glob("compiled-*"))) == 1
    home = probe.parent / "home"
    assert run(probe, HOME=str(home), XDG_CACHE_HOME="not/absolute") == (COLD, [])
    assert len(list((home / ".cache" / "fbid_gym").glob("compiled-*"))) == 1


def test_where_nothing_can_be_written_one_line_says_so(probe):
    forbid(probe / "__pycache__")
    cache = forbid(probe.parent / "cache")
    for _ in range(2):
        found, (said,) = run(probe, XDG_CACHE_HOME=cache)
        assert found == COLD
        assert "cannot be kept" in said and str(probe / "__pycache__") in said and cache in said


@pytest.mark.slow
def test_truncated_files_are_made_anew(probe):
    assert run(probe) == (COLD, [])
    (file,) = (f for f in probe.glob("__pycache__/compiled-*/*") if f.suffix != ".lock")
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    assert run(probe) == (COLD, [])
    assert run(probe) == (WARM, [])


def test_of_processes_that_start_at_once_one_compiles_and_the_others_wait(probe):
    found = [end(process) for process in [start(probe) for _ in range(3)]]
    assert sorted(found) == [(COLD, []), *[(WARM, [])] * 2]
