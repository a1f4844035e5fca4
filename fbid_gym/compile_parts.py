"""What `@compiled` makes: functions that become machine code only as a part of what calls them.

Numba optimises each function together with all that it calls, and makes machine code of it, before
the function that calls it is compiled, where all of that happens again: five or six times for what
lies deep inside a law. A part stops before: what calls it takes it over as it is, and only what
Python calls is optimised, once. That saves two fifths of the time of a first use.

A part counts references to arrays only if it makes some itself: Numba counts those of every array
of every named tuple, up when a function begins and down when it ends, one after another, each an
atomic step. In gaits and laws on limited forces there were hundreds of them for a robot and tick.

This uses Numba's compiler pipeline, which may be extended, and its code library, which is internal;
`tests/test_compile_parts.py` holds that both still do what is said here.
"""

import functools
from collections.abc import Callable
from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder
from numba.core.compiler_machinery import register_pass
from numba.core.ir import Assign, Expr, SetItem, StaticSetItem
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


# Expressions whose arrays are those of their operands, or views of them.
_BORROWED = ("getattr", "getitem", "static_getitem", "build_tuple", "cast", "exhaust_iter", "phi")


def _makes_arrays(state: Any) -> bool:
    """Whether a function makes an array, is given one by what it calls, or returns one.

    One that does not has no need to count references: its caller keeps what it is passed.
    """

    def counted(kind: Any) -> bool:
        return bool(state.targetctx.data_model_manager[kind].contains_nrt_meminfo())

    def makes(step: Any) -> bool:
        if isinstance(step, SetItem | StaticSetItem):  # of an array it makes a copy first
            return counted(state.typemap[step.value.name])
        if not (isinstance(step, Assign) and isinstance(step.value, Expr)):
            return False
        if step.value.op == "getitem" and counted(state.typemap[step.value.index.name]):
            return True  # what an array chooses is a copy
        return step.value.op not in _BORROWED and counted(state.typemap[step.target.name])

    steps = (step for block in state.func_ir.blocks.values() for step in block.body)
    return counted(state.return_type) or any(map(makes, steps))


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(NativeLowering):
    _name = "lowering_of_a_part"

    def run_pass(self, state: Any) -> bool:
        if not _makes_arrays(state):
            state.targetctx = state.targetctx.subtarget(enable_nrt=False)
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
    chosen = {**part_options(options, inlined), "nopython": True, "boundscheck": None}
    pipeline = chosen.pop("pipeline_class")
    return _Part(function, targetoptions=chosen, pipeline_class=pipeline)


class _Part(CPUDispatcher):
    """A part. Python calls another function, which is compiled for that."""

    def __call__(self, *args: Any) -> Any:
        return self._whole(*args)

    @functools.cached_property
    def _whole(self) -> Callable[..., Any]:
        options = {**self.targetoptions, "no_cpython_wrapper": False}
        return CPUDispatcher(self.py_func, targetoptions=options)
