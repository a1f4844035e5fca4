"""Cache of compiled functions across processes, and the progress shown while compiling.

They lie in a folder named after the sources of all of them: a compiled function contains what it
calls, whichever file that lies in, so a change anywhere leads to another folder. The folder is, in
this order, in NUMBA_CACHE_DIR if that is set, and nowhere else; beside the sources; in the user's
cache (XDG_CACHE_HOME, by default ~/.cache), for an installation that cannot be written. Where none
can be written, every process compiles for itself. A file that cannot be read, because a disk was
full, counts as absent. Of several processes that start at once, one compiles and the others wait.
"""

import gc
import hashlib
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numba
from filelock import FileLock, Timeout
from numba.core.compiler import CompileResult

_MOMENT, _WHILE = 2.0, 5.0
"""s of compiling without a word, and from line to line after that."""
_PATIENCE = 300.0
"""s to wait for another process; whoever has waited that long compiles for itself."""


def folders(package: Path) -> tuple[Path, ...]:
    """Return where the compiled functions of a package may lie, the best place first."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    for path in sorted(package.rglob("*.py")):  # all that say what is compiled, how, of what tuples
        source, words = path.read_bytes(), (b"@compiled", b"@kernel", b"NamedTuple")
        if path.stem.startswith("compile") or any(word in source for word in words):
            digest.update(source)
    name = f"compiled-{digest.hexdigest()[:16]}"
    if numba.config.CACHE_DIR:
        return (Path(numba.config.CACHE_DIR) / name,)
    given = os.environ.get("XDG_CACHE_HOME", "")
    # The convention: what is not absolute does not count.
    user = Path(given if os.path.isabs(given) else os.path.expanduser("~/.cache"))
    return package / "__pycache__" / name, user / "fbid_gym" / name


def kept(dispatcher: Any, places: Sequence[Path]) -> Any:
    """Return one of Numba's compiled functions, from now on kept in the first place that can be."""
    cache = _Cache(dispatcher.py_func, places)
    dispatcher._cache, find_or_compile = cache, dispatcher.compile

    def compile_in_turn(signature: Any) -> Any:
        with cache.turn():
            return find_or_compile(signature)

    dispatcher.compile = compile_in_turn
    # What Numba calls where it has found nothing.
    dispatcher._compiler.compile = NEWS.of(dispatcher._compiler.compile, cache.name)
    return dispatcher


class _Cache:
    """The cache that Numba reads the compiled forms of a function from and saves new ones to."""

    def __init__(self, function: Callable[..., Any], places: Sequence[Path]) -> None:
        self.name = f"{function.__module__}.{function.__qualname__}"
        self._places, self.cache_path = places, str(places[0])

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the form for a signature; None where there is none, or it cannot be read."""
        context.refresh()
        for place in self._places:
            with suppress(Exception):  # a truncated file raises almost anything
                found = pickle.loads((place / self._file(signature, context)).read_bytes())
                return CompileResult._rebuild(context, *found)
        return None

    def save_overload(self, signature: Any, form: Any) -> None:
        """Write the form to the first place that can be written."""
        data, name = pickle.dumps(form._reduce()), self._file(signature, form.target_context)
        for place in self._places:
            with suppress(OSError):
                place.mkdir(parents=True, exist_ok=True)
                written = place / f"{name}.{os.getpid()}"
                written.write_bytes(data)
                written.replace(place / name)
                return
        tried = " nor ".join(str(place.parent) for place in self._places)
        end = f"cannot write to {tried} (NUMBA_CACHE_DIR names another folder)."
        NEWS.say(f"compiled code cannot be kept, so every start compiles anew: {end}")

    @contextmanager
    def turn(self) -> Iterator[None]:
        """Keep other processes from compiling the same, where a file can be locked."""
        lock = None
        for place in self._places:
            with suppress(OSError, NotImplementedError):
                place.mkdir(parents=True, exist_ok=True)
                lock = FileLock(place / f"{self.name}.lock")
                with suppress(Timeout):
                    lock.acquire(timeout=_MOMENT)
                if not lock.is_locked:
                    NEWS.say("waiting for another process, which compiles the control laws.")
                    with suppress(Timeout):
                        lock.acquire(timeout=_PATIENCE)
                break
        try:
            yield
        finally:
            if lock:
                lock.release()

    def _file(self, signature: Any, context: Any) -> str:
        form = f"{signature} {context.codegen().magic_tuple()}"  # types and processor
        return f"{self.name}-{hashlib.sha256(form.encode()).hexdigest()[:16]}"


class _News:
    """Says on standard error what happens, in a line now and then; nothing where `silent`."""

    silent = False

    def __init__(self) -> None:
        self._said: set[str] = set()
        self._count, self._spent, self._next = 0, 0.0, _MOMENT

    def say(self, text: str) -> None:
        """Print a line unless this has been said before."""
        if text not in self._said and not self.silent:
            self._said.add(text)
            print(f"fbid_gym: {text}", file=sys.stderr, flush=True)

    def of(self, build: Callable[..., Any], name: str) -> Callable[..., Any]:
        """Return what compiles as `build` does, and says so whenever that has taken a while."""

        def build_and_say(*arguments: Any) -> Any:
            self._count += 1
            line = f"compiling for the first use: function {self._count}, {name}"
            timer = threading.Timer(max(self._next - self._spent, 0.0), self.say, (line,))
            timer.daemon = True
            timer.start()
            collects, began = gc.isenabled(), time.monotonic()
            gc.disable()  # a compiler makes millions of objects at once, and keeps most of them
            try:
                return build(*arguments)
            finally:
                if collects:
                    gc.enable()
                timer.cancel()
                self._spent += time.monotonic() - began
                if self._spent > self._next:
                    self._next = self._spent + _WHILE

        return build_and_say


NEWS = _News()
