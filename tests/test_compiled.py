"""What is compiled is kept on disk, and never used once any of its sources has changed."""

import subprocess
import sys
from pathlib import Path

import pytest

KERNELS = """
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
RUN = """
import sys
from pathlib import Path
import numpy as np
from fbid_gym import compiled
compiled._PACKAGE = Path("probe").resolve()
compiled._FOLDER = f"compiled-{compiled._fingerprint()}"
from probe.outer import scale
x = np.ones(3)
scale(x)
hits = sum(scale.entry.stats.cache_hits.values())
print(x[0], hits)
"""


@pytest.fixture
def probe(tmp_path: Path) -> Path:
    """A package with a kernel that calls a function of another file."""
    folder = tmp_path / "probe"
    folder.mkdir()
    (folder / "__init__.py").touch()
    (folder / "outer.py").write_text(KERNELS)
    (folder / "inner.py").write_text(INNER.format(factor=2.0))
    return folder


def run(probe: Path) -> list[str]:
    """What a fresh process computes, and whether it found the kernel on disk."""
    command = [sys.executable, "-c", RUN]
    result = subprocess.run(command, cwd=probe.parent, capture_output=True, text=True, check=True)
    return result.stdout.split()


def test_kernels_are_kept_until_what_they_call_changes(probe: Path) -> None:
    assert run(probe) == ["2.0", "0"]
    assert run(probe) == ["2.0", "1"]
    # Another file, of the same size: the kernel's own is as it was.
    (probe / "inner.py").write_text(INNER.format(factor=3.0))
    assert run(probe) == ["3.0", "0"]
    assert run(probe) == ["3.0", "1"]
