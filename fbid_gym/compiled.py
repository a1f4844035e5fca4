"""Compilation of the loops over robots that every control tick runs, and their door to Python.

A tick of one robot is some ten thousand multiplications: a few microseconds, and a hundred times as
much if each array operation on the way is a call of its own. So what runs at every tick is compiled
by Numba, one robot after another: `@kernel` on functions that Python calls too, `@compiled` on
those that only compiled code calls.

Rules for both:

- Arguments are named tuples (`fbid_gym.quantities`), C-contiguous arrays of float64, bool or int64
  (MuJoCo's own also of int32) with the batch axis first, and numbers; results likewise, in fresh
  arrays. A slice of an array of one robot is contiguous and that of many is not, so slices would be
  compiled twice, and rounded differently. A function that writes to an argument says so.
- Whoever makes a tuple checks shapes and types. Nothing raises: robots that are not finite get such
  results, the others do not notice.
- A function that makes arrays, or calls `f(*a, *b)`, leaves loops to one that does neither, else
  uses of its arguments' fields are counted.
- A first use waits for the compiler. So there are no operations on whole arrays, slices or rows
  (`small_matrices.copy`), and a loop or a helper rather than the same lines for each axis.

Inside compiled code a named tuple costs nothing. On the way in from Python, Numba takes a
microsecond for each: so `kernel` makes a door, which passes the fields on one by one, 60 ns an
array, to an entry that builds the tuples inside. Entries are compiled on first use and ours kept on
disk (`fbid_gym.compile_cache`); none holds Python's lock. NUMBA_DISABLE_JIT=1: all is Python.
"""

from collections.abc import Callable
from functools import cached_property, update_wrapper
from pathlib import Path
from typing import Any, TypeVar, get_type_hints

from numba import config, njit, types
from numba.extending import typeof_impl

from fbid_gym.compile_cache import folders, kept
from fbid_gym.compile_entry import door_to, entry_to, is_tuple
from fbid_gym.compile_parts import PartCompiler

Function = TypeVar("Function", bound=Callable[..., Any])

_OURS, _PLACES = __name__.partition(".")[0], folders(Path(__file__).parent)
# Division by zero gives infinity, as in NumPy. Sums may be taken in any order, and so side by side.
# Nobody calls from C: without a wrapper for that, there is less to compile.
_OPTIONS: dict[str, Any] = {
    "nogil": True,
    "error_model": "numpy",
    "fastmath": {"reassoc", "contract"},
    "no_cfunc_wrapper": True,
}


def compiled(function: Function) -> Function:
    """Compile a function for the use of kernels."""
    return function if config.DISABLE_JIT else _Part(function)  # type: ignore[return-value]


def kernel(function: Function) -> Function:
    """Compile an annotated function for the use of Python and of other kernels.

    Args:
        function: its annotations say which arguments, and whether the result, are named tuples.

    Returns:
        A function of the same arguments, all positional; its `entry` is what Numba made of it.
    """
    return function if config.DISABLE_JIT else _Kernel(function)  # type: ignore[return-value]


class _Part:
    """A function as compiled code and Python see it."""

    __wrapped__: Callable[..., Any]
    __qualname__: str

    def __init__(self, function: Callable[..., Any]) -> None:
        update_wrapper(self, function)

    @cached_property
    def part(self) -> Any:
        """What compiled code calls.

        Passing the fields of tuples on costs more than it seems, so a function that takes some, or
        may, is inlined. What takes arrays is left to the compiler's own choice.
        """
        kinds = [kind for name, kind in self.kinds.items() if name != "return"]
        options = {"no_cpython_wrapper": True, "pipeline_class": PartCompiler}
        options["forceinline"] = any(kind is Any or is_tuple(kind) for kind in kinds)
        return njit(self.__wrapped__, **_OPTIONS, **options)

    @cached_property
    def entry(self) -> Any:
        """What Python calls."""
        of_leaves = isinstance(self, _Kernel)
        entry = njit(entry_to(self, self.kinds) if of_leaves else self.__wrapped__, **_OPTIONS)
        # The places are named after our sources: those of others may have changed.
        return kept(entry, _PLACES) if self.__module__.partition(".")[0] == _OURS else entry

    @cached_property
    def kinds(self) -> dict[str, Any]:
        """Type hints of the arguments, and of the result as "return"."""
        return get_type_hints(self.__wrapped__)

    def __call__(self, *arguments: Any) -> Any:
        return self.entry(*arguments)

    def __reduce__(self) -> str:
        return self.__qualname__  # as functions are pickled: by name


class _Kernel(_Part):
    @cached_property
    def _door(self) -> Callable[..., Any]:
        return door_to(self.entry, self.kinds)

    def __call__(self, *arguments: Any) -> Any:
        return self._door(*arguments)


@typeof_impl.register(_Part)
def _type_of(function: _Part, context: Any) -> Any:
    return types.Dispatcher(function.part)
