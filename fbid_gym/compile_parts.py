"""Compile `@compiled` functions: only as a part of the kernels that call them.

Numba optimises each function together with all that it calls, and makes machine code of it, before
the function that calls it is compiled, where all of that happens again: five or six times for what
lies deep inside a law. A part is only tidied up; what calls it takes it over as it is, and the
kernel is optimised as a whole, once.

A part counts references to arrays only if it makes some itself, else its caller keeps what it is
passed: Numba counts those of every array of every named tuple, up when a function begins and down
when it ends, each an atomic step. That were hundreds for a robot and tick.

This uses Numba's compiler pipeline, which may be extended, and its code library, which is internal;
`tests/test_compiled.py` holds that both still do what is said here.
"""

from typing import Any

from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering


class _PartLibrary(JITCodeLibrary):
    """Code to be linked into other code, and never run from here."""

    def _optimize_final_module(self) -> None:
        """Leave it to whoever calls this."""

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
        """Tell nobody."""


# Expressions whose arrays are those of their operands, or views of them.
_BORROWED = ("getattr", "getitem", "static_getitem", "build_tuple", "cast", "exhaust_iter", "phi")


def _makes_arrays(state: Any) -> bool:
    """Whether a function makes an array, is given one by what it calls, or returns one."""

    def counted(kind: Any) -> bool:
        return bool(state.targetctx.data_model_manager[kind].contains_nrt_meminfo())

    def makes(step: Any) -> bool:
        value: Any = getattr(step, "value", None)
        if type(step).__name__ in ("SetItem", "StaticSetItem"):  # of an array it makes a copy first
            return counted(state.typemap[value.name])
        if type(value).__name__ != "Expr":
            return False
        if value.op == "getitem" and counted(state.typemap[value.index.name]):
            return True  # what an array chooses is a copy
        return value.op not in _BORROWED and counted(state.typemap[step.target.name])

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


class PartCompiler(Compiler):
    """Compiles a part."""

    def define_pipelines(self) -> list[Any]:
        """Return Numba's usual stages, the one that ends in machine code replaced."""
        (usual,) = super().define_pipelines()
        usual.passes = [
            (_PartLowering if stage is NativeLowering else stage, about)
            for stage, about in usual.passes
        ]
        usual.finalize()
        return [usual]
