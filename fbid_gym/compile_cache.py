"""Where compiled functions are kept from process to process, and what a user hears of compiling.

They lie in a folder named after the sources of all of them: a compiled function contains what it
calls, whichever file that lies in, so a change anywhere leads to another folder. The folder is, in
this order, in NUMBA_CACHE_DIR if that is set, and nowhere else; beside the sources; in the user's
cache (XDG_CACHE_HOME, by default ~/.cache), for an installation that cannot be written. Where none
can be written, every process compiles for itself. Files that cannot be read, because a process was
killed or a disk was full, count as absent and are written anew. Of several processes that start at
once, one compiles a function and the others wait for it (`compile_turn`), unless that one fails.
"""

import hashlib
import os
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    _CacheLocator,
)

from fbid_gym.compile_turn import Turn

_MOMENT = 1.0
"""s of compiling without a word."""


def folders(package: Path) -> tuple[Path, ...]:
    """Return where the compiled functions of a package may lie, the best place first."""
    name = f"compiled-{_fingerprint(package)}"
    if numba.config.CACHE_DIR:
        return (Path(numba.config.CACHE_DIR) / name,)
    given = os.environ.get("XDG_CACHE_HOME", "")
    # The convention: what is not absolute does not count.
    user = Path(given if os.path.isabs(given) else os.path.expanduser("~/.cache"))
    return package / "__pycache__" / name, user / "fbid_gym" / name


def kept(dispatcher: Any, places: Sequence[Path]) -> Any:
    """Return one of Numba's compiled functions, from now on kept in the first place that can be."""
    cache, compiler = _Cache(dispatcher.py_func, places), dispatcher._compiler
    dispatcher._cache, compiler.compile = cache, cache.giving(compiler.compile)
    return dispatcher


def say_nothing_of_compiling() -> None:
    """Let this process compile in silence: for a caller that shows by itself what it does."""
    _NEWS.know("compiling")
    _NEWS.know("waiting")


def _fingerprint(package: Path) -> str:
    """Of all files that say what is compiled, how, and what tuples it takes."""
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        source = path.read_bytes()
        words = (b"@compiled", b"@kernel", b"NamedTuple")
        if path.stem.startswith("compile") or any(word in source for word in words):
            digest.update(source)
    return digest.hexdigest()[:16]


class _Files(IndexDataCacheFile):
    """The files of one function in one folder."""

    def _load_index(self) -> dict[Any, str]:
        return _read(super()._load_index) or {}

    def load(self, key: Any) -> Any:
        return _read(lambda: super(_Files, self).load(key))

    def save(self, key: Any, data: Any) -> None:
        Path(self._cache_path).mkdir(parents=True, exist_ok=True)
        super().save(key, data)


def _read(load: Callable[[], Any]) -> Any:
    """What is in a file; None where that cannot be told."""
    try:
        return load()
    except Exception:  # a truncated pickle raises almost anything, and none of it matters
        return None


class _Places:
    """The files of a function in every folder: read from any, written to the first possible."""

    def __init__(self, files: Sequence[_Files]) -> None:
        self._files = files

    def load(self, key: Any) -> Any:
        found = (files.load(key) for files in self._files)
        return next((data for data in found if data is not None), None)

    def save(self, key: Any, data: Any) -> None:
        for files in self._files:
            try:
                return files.save(key, data)
            except OSError:
                continue
        places = " nor ".join(str(Path(files._cache_path).parent) for files in self._files)
        _NEWS.say(
            "nowhere",
            f"compiled code cannot be kept, so every start compiles anew: cannot write to {places}"
            " (NUMBA_CACHE_DIR names another folder).",
        )

    def flush(self) -> None:
        for files in self._files:
            files.flush()


class _Locator(_CacheLocator):
    """Names the files of a function. Where they lie is up to `_Places`."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        # Numba names it where something cannot be kept.
        self._py_file = function.__code__.co_filename

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "_Locator":
        return cls(function)

    def get_disambiguator(self) -> str:
        return self._function.__module__

    def get_source_stamp(self) -> str:
        return ""  # in the folder's name

    def get_cache_path(self) -> str:
        return ""

    def ensure_cache_path(self) -> None:
        pass


class _Form(CompileResultCacheImpl):
    _locator_classes = [_Locator]


class _Cache(FunctionCache):
    """What Numba asks for the compiled forms of a function, and gives new ones to."""

    _impl_class = _Form

    def __init__(self, function: Callable[..., Any], places: Sequence[Path]) -> None:
        super().__init__(function)
        name, stamp = self._impl.filename_base, self._impl.locator.get_source_stamp()
        self._cache_file = _Places([_Files(str(place), name, stamp) for place in places])
        self._turn = Turn([place / f"{name}.lock" for place in places])

    def load_overload(self, signature: Any, target: Any) -> Any:
        def load() -> Any:
            return super(_Cache, self).load_overload(signature, target)

        found = load()
        if found is None:
            found = self._turn.take(load, _NEWS.waiting)
        if found is None:
            _NEWS.compiling()
        return found

    def giving(self, build: Callable[..., Any]) -> Callable[..., Any]:
        """Return what compiles as `build` does, and gives the turn away where that fails.

        Numba saves nothing then. The process may live on, after Ctrl-C in a notebook or an error of
        typing, and others would wait for what never comes.
        """

        def build_or_give(*args: Any) -> Any:
            try:
                return build(*args)
            except BaseException:
                _NEWS.compiled()
                self._turn.give()
                raise

        return build_or_give

    def save_overload(self, signature: Any, data: Any) -> None:
        _NEWS.compiled()
        try:
            super().save_overload(signature, data)
        finally:
            self._turn.give()


class _News:
    """Says what happens, each thing once per process, in one line on standard error."""

    def __init__(self) -> None:
        self._said: set[str] = set()
        self._spent = 0.0
        self._began = 0.0
        self._timer: threading.Timer | None = None

    def know(self, what: str) -> None:
        """Take something for said."""
        self._said.add(what)

    def say(self, what: str, text: str) -> None:
        """Print a line unless this has been said before."""
        if what not in self._said:
            self.know(what)
            print(f"fbid_gym: {text}", file=sys.stderr, flush=True)

    def waiting(self, seconds: float) -> None:
        """Another process compiles, for some seconds now."""
        if seconds >= _MOMENT:
            self.say("waiting", "waiting for another process, which compiles the control laws.")

    def compiling(self) -> None:
        """Compilation begins; to be said once all of it has taken a moment."""
        self._began = time.monotonic()
        text = "compiling the control laws for their first use, which may take a minute or two."
        left = max(_MOMENT - self._spent, 0.0)
        self._timer = threading.Timer(left, self.say, ("compiling", text))
        self._timer.daemon = True
        self._timer.start()

    def compiled(self) -> None:
        """Compilation has ended."""
        if self._timer is not None:
            self._timer.cancel()
        self._spent += time.monotonic() - self._began


_NEWS = _News()
