"""Versions of the software behind a run."""

import importlib.metadata
import os
import platform
import subprocess
from pathlib import Path
from typing import Any

_PACKAGES = (
    "fbid-gym", "gymnasium", "mujoco", "numpy", "pin", "safetensors", "stable-baselines3", "torch",
)  # fmt: skip


def versions() -> dict[str, Any]:
    """Return the versions of Python, the packages, this repository and the platform."""
    return {
        "python": platform.python_version(),
        "packages": package_versions(),
        **_git(Path(__file__).resolve().parent),
        # Only parts that results may depend on: not the build of the kernel.
        "platform": f"{platform.system()}-{platform.machine()}-{''.join(platform.libc_ver())}",
        "cpu_count": os.cpu_count(),
    }


def package_versions() -> dict[str, str]:
    """Return the versions of the packages that a result may depend on; absent ones are left out."""
    found = {}
    for name in _PACKAGES:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found


def _git(folder: Path) -> dict[str, Any]:
    """Return the commit and whether tracked files differ from it; None outside a repository."""

    def ask(*arguments: str) -> str:
        return subprocess.run(
            ["git", "-C", str(folder), *arguments],
            capture_output=True, text=True, check=True, timeout=10,
        ).stdout.strip()  # fmt: skip

    try:
        ask("ls-files", "--error-unmatch", Path(__file__).name)  # or it is a repository of others
        commit = ask("rev-parse", "HEAD")
        dirty = bool(ask("status", "--porcelain", "--untracked-files=no"))
    except (OSError, subprocess.SubprocessError):
        return {"commit": None, "uncommitted_changes": None}
    return {"commit": commit, "uncommitted_changes": dirty}
