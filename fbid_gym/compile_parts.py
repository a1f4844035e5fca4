"""What `@compiled` makes: functions that become machine code only as a part of what calls them.

Numba optimises each function together with all that it calls, and makes machine code of it, before
the function that calls it is compiled, where all of that happens again: five or six times for what
lies deep inside a law. A part stops before: what calls it takes it over as it is, and only what
Python calls is optimised, once. That saves two fifths of the time of a first use.

This uses Numba's compiler pipeline, which may be extended, and its code library, which is internal;
`tests/test_compile_parts.py` holds that both still do what is said here.
"""

import functools
from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.registry import CPUDispatcher
from numba.core.typed_passes import NativeLowering


class _PartLibrary(JITCodeLibrary):
    """Code to be linked into other code, and never run from here."""

    def _optimize_final_module(self) -> None:
        """Take together what is called here, in short; the rest is up to whoever calls this."""
        passes, builder = self._codegen._module_pass_manager(cost="cheap", slp_vectorize=False)
        passes.run(self._final_module, builder)

    def _finalize_final_module(self) -> None:
        """Do what Numba's own does, but for machine code."""
        self._finalize_dynamic_globals()
        self._finalized = True

    def get_pointer_to_function(self, name: str) -> int:
        """Say that there is none."""
        return 0

    @property
    def codegen(self) -> "_PartLibrary":
        """Whom Numba asks to tell the machine code its environment."""
        return self

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing: there is no machine code to be told."""


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    _name = "lowering_of_a_part"

    def run_pass(self, state: Any) -> bool:
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return bool(super().run_pass(state))


class _PartCompiler(CompilerBase):
    def define_pipelines(self) -> list[Any]:
        """Return the usual stages, the one that ends in machine code replaced."""
        usual = DefaultPassBuilder.define_nopython_pipeline(self.state)
        usual.passes = [
            (_PartLowering if stage is NativeLowering else stage, about)
            for stage, about in usual.passes
        ]
        usual.finalize()
        return [usual]


def part_options(options: dict[str, Any], inlined: bool) -> dict[str, Any]:
    """Return Numba's options for a part, given those for what Python calls.

    Args:
        options: of what Python calls.
        inlined: whether what calls the part is to hold all of it wherever it does.
    """
    return {
        **options,
        "no_cpython_wrapper": True,
        "forceinline": inlined,
        "pipeline_class": _PartCompiler,
    }


def part(function: Callable[..., Any], options: dict[str, Any], inlined: bool) -> Any:
    """Return a function for compiled code to call; the arguments are those of `part_options`."""
    chosen = {
        **options,
        "forceinline": inlined,
        "nopython": True,
        "boundscheck": None,
        "no_cpython_wrapper": True,
    }
    return _Part(function, targetoptions=chosen, pipeline_class=_PartCompiler)


class _Part(CPUDispatcher):
    """A part. Python calls another function, which is compiled for that."""

    def __call__(self, *args: Any) -> Any:
        return self._whole(*args)

    @functools.cached_property
    def _whole(self) -> Callable[..., Any]:
        options = {**self.targetoptions, "no_cpython_wrapper": False}
        return CPUDispatcher(self.py_func, targetoptions=options)
