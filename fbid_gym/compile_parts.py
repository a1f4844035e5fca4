"""How `@compiled` functions become machine code: only as a part of the kernels that call them.

Numba optimises each function together with all that it calls, and makes machine code of it, before
the function that calls it is compiled, where all of that happens again: five or six times for what
lies deep inside a law. A part is only tidied up; what calls it takes it over as it is, and the
kernel is optimised as a whole, once.

Numba passes a tuple on field by field, and an array as ten numbers: nine tenths of the text that it
wrote for LLVM took tuples apart at calls and put them together again. Here named tuples are passed
whole, from kernels to parts and from part to part. So parts are called by nothing else.

A part counts references to arrays only if it makes some itself, else its caller keeps what it is
passed: Numba counts those of every array of every named tuple, up when a function begins and down
when it ends, each an atomic step. That were hundreds for a robot and tick.

This uses Numba's compiler pipeline and data models, which may be extended, and its code library and
lowering, which are internal; `tests/test_compiled.py` holds that they still do what is said here.
"""

import re
from collections import Counter
from functools import cache
from typing import Any

from numba import types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.compiler_machinery import register_pass
from numba.core.typed_passes import NativeLowering
from numba.extending import models


class _PartLibrary(JITCodeLibrary):
    """Code to be linked into other code, and never run from here."""

    def _optimize_functions(self, module: Any) -> None:
        """Tidy up what is defined here; Numba sets up its passes for each declaration too."""
        module.data_layout = self._codegen._data_layout
        passes, builder = self._codegen._function_pass_manager()
        for function in module.functions:
            if not function.is_declaration:
                passes.run(function, builder)

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


class _Lower(NativeLowering().lowering_class):  # type: ignore[misc]
    """Writes a function for LLVM; arguments stay values, where Numba copies them to the stack."""

    def _find_singly_assigned_variable(self) -> None:
        super()._find_singly_assigned_variable()
        steps = [s for block in self.blocks.values() for s in block.body]
        steps = [step for step in steps if type(step).__name__ == "Assign"]
        written = Counter(step.target.name for step in steps)
        given = (step.target.name for step in steps if type(step.value).__name__ == "Arg")
        self._singly_assigned_vars |= {name for name in given if written[name] == 1}


def _as_it_is(model: Any, builder: Any, value: Any) -> Any:
    return value


@cache
def _whole(usual: Any) -> Any:
    """How kernels and parts see values: as usual, but for named tuples."""
    found = type(usual)().chain(usual)
    kinds = (types.NamedTuple, models.TupleModel), (types.NamedUniTuple, models.UniTupleModel)
    for kind, model in kinds:  # of fields of several kinds, and of one
        own = {"get_argument_type": model.get_value_type}
        own |= {"as_argument": _as_it_is, "from_argument": _as_it_is}
        found.register(kind, type("Whole", (model,), own))
    return found


@register_pass(mutates_CFG=True, analysis_only=False)
class _EntryLowering(NativeLowering):
    _name = "lowering_of_an_entry"
    lowering_class = _Lower

    def run_pass(self, state: Any) -> bool:
        usual = state.targetctx.data_model_manager
        state.targetctx = state.targetctx.subtarget(data_model_manager=_whole(usual))
        return bool(super().run_pass(state))


@register_pass(mutates_CFG=True, analysis_only=False)
class _PartLowering(_EntryLowering):
    _name = "lowering_of_a_part"

    def run_pass(self, state: Any) -> bool:
        if not _makes_arrays(state):
            state.targetctx = state.targetctx.subtarget(enable_nrt=False)
        state.library = _PartLibrary(state.targetctx.codegen(), state.func_id.func_qualname)
        return bool(super().run_pass(state))


# Stages for what is in no kernel; each costs milliseconds for every function.
_NEEDLESS = re.compile("contexts|inline|raises|make_function|literal|valid form|parfor")


class EntryCompiler(Compiler):
    """Compiles what Python calls."""

    lowering: type = _EntryLowering

    def define_pipelines(self) -> list[Any]:
        """Return Numba's usual stages, but for the one that ends in machine code."""
        (usual,) = super().define_pipelines()
        usual.passes = [
            (self.lowering if stage is NativeLowering else stage, about)
            for stage, about in usual.passes
            if not _NEEDLESS.search(about)
        ]
        usual.finalize()
        return [usual]


class PartCompiler(EntryCompiler):
    """Compiles a part."""

    lowering = _PartLowering
