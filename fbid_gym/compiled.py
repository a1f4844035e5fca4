"""Compilation of the loops over robots that every control tick runs.

A tick of one robot is some ten thousand multiplications: a few microseconds, and a hundred times as
much if each array operation on the way is a call of its own. So what runs at every tick is compiled
by Numba, one robot after another: `@kernel` on the functions that Python calls, `@compiled` on
those that kernels call.

Rules for both:

- Plain arguments: C-contiguous arrays of float64, bool or int64, with the batch axis first, and
  numbers. A slice of an array of one robot is contiguous and that of many is not, so slices would
  be compiled twice, and rounded differently. Named tuples cost microseconds to unpack; only
  `@compiled` functions take them.
- The caller checks shapes and allocates the results, the kernel fills them.
- Nothing raises. A robot that is not finite gets results that are not, and the others do not
  notice.

Kernels are compiled on first use and then kept on disk, in a folder named after the sources of all
of them: a kernel contains what it calls, whichever file that lies in. Python's lock is released
while they run.
"""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba import njit

Function = TypeVar("Function", bound=Callable[..., Any])

_PACKAGE = Path(__file__).parent
# Division by zero gives infinity, as in NumPy. Sums may be taken in any order, and so side by side.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"reassoc", "contract"}}


def _fingerprint() -> str:
    """Of all files that hold compiled functions."""
    digest = hashlib.sha256()
    for path in sorted(_PACKAGE.rglob("*.py")):
        source = path.read_bytes()
        if b"@compiled" in source or b"@kernel" in source:
            digest.update(source)
    return digest.hexdigest()[:16]


_FOLDER = f"compiled-{_fingerprint()}"


def compiled(function: Function) -> Function:
    """Compile a function for the use of kernels."""
    return njit(**_OPTIONS)(function)


def kernel(function: Function) -> Function:
    """Compile a function for the use of Python, and keep it on disk."""
    given = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(Path(given or _PACKAGE / "__pycache__") / _FOLDER)
    try:
        return njit(cache=True, **_OPTIONS)(function)
    finally:
        numba.config.CACHE_DIR = given
