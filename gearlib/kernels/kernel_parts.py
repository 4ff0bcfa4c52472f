"""Kernels as parts of those that call them: without machine code of their own.

numba makes machine code of each kernel together with all that it calls, so that a kernel at the
bottom is translated once for every one above it. A part is optimised only: who is
called from Python takes it in and translates all at once. A part too large to be inlined is taken
in when its callers have been optimised: passes take longer than their share over long functions,
and would go through it again for every level above it.
"""

from llvmlite import binding
from llvmlite.binding import Linkage
from numba import types
from numba.core import typed_passes, untyped_passes
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import CompilerBase, DefaultPassBuilder, compile_result
from numba.core.compiler_lock import require_global_compiler_lock
from numba.core.compiler_machinery import PassManager

#: Kind of what `PartLibrary.serialize_using_object_code` gives, beside numba's own.
_PART = "part"
#: Instructions beyond which LLVM inlines no call: its limits lie near a hundred.
_LARGE = 400
#: Rooms whose functions are optimised where they are linked only, a tenth of their compilation:
#: those of Taylor steps were 15 % slower, these are as fast.
_LINKED = {"closed_form", "several_meshes"}
#: Passes of numba for what no kernel has: functions within it, Python objects, unrolled tuples.
_NEEDLESS = {
    untyped_passes.WithLifting,
    untyped_passes.InlineClosureLikes,
    untyped_passes.InlineInlinables,
    untyped_passes.FindLiterallyCalls,
    untyped_passes.LiteralUnroll,
    untyped_passes.LiteralPropagationSubPipelinePass,
    typed_passes.InlineOverloads,
    typed_passes.DumpParforDiagnostics,
}


def _key():
    # numba takes nothing but a built-in function, and no two may be equal.
    return object().__dir__


def _link(library):
    """Link into a library what it calls; return symbol -> bitcode of what is too large for that."""
    large = {}
    for called in dict.fromkeys(library._linking_libraries):
        library._reload_init.update(called._reload_init)
        large.update(getattr(called, "large", {}))
        if not getattr(called, "stays_apart", False):
            library._final_module.link_in(called._get_module_for_linking(), preserve=True)
    return large


class _Library(JITCodeLibrary):
    """The code of one function."""

    def __init__(self, target, name, function=None):
        super().__init__(target.codegen(), name)
        self.linked = bool(function and _LINKED.intersection(function.__module__.split(".")))

    def _optimize_functions(self, module):
        """Optimise function by function, before what they call is known."""
        module.data_layout = self._codegen._data_layout
        if not self.linked:
            super()._optimize_functions(module)


class PartLibrary(_Library):
    """The code of one kernel and of the parts that it calls."""

    #: Symbol -> bitcode of what is optimised by itself: parts called, and this one if it is large.
    large: dict[str, bytes]
    stays_apart = False

    def finalize(self):
        """Take in what the kernel calls, and optimise."""
        self._raise_if_finalized()
        self.large = _link(self)
        # Optimised in its callers only, Taylor steps were 7 % slower, trains up to 20 %.
        self._optimize_final_module()
        self._finalized = True
        own = [f for f in self._final_module.functions if f.linkage == Linkage.external]
        (kernel,) = [f for f in own if not f.is_declaration]
        # A line for each: one by one they take a fiftieth of all compilation.
        size = str(kernel).count("\n")
        if size > _LARGE and not any(b"alwaysinline" in text for text in kernel.attributes):
            self.stays_apart = True
            # Kept whether or not what is linked before it calls it, and the same wherever from.
            kernel.linkage = Linkage.weak_odr
            self.large[kernel.name] = self._final_module.as_bitcode()

    def serialize_using_object_code(self):
        """Return what a file keeps of it: there is no object code."""
        self._ensure_finalized()
        own = b"" if self.stays_apart else self._get_module_for_linking().as_bitcode()
        return self.name, _PART, (own, self.large)


class KernelLibrary(_Library):
    """The machine code of a kernel that is called from Python."""

    def finalize(self):
        """Optimise, then take in the large parts, which are, and translate."""
        require_global_compiler_lock()
        self._raise_if_finalized()
        large = _link(self)
        self._optimize_final_module()
        for code in large.values():
            self._final_module.link_in(binding.parse_bitcode(code))
        self._final_module.verify()
        self._finalize_final_module()


def _remember(typing):
    """Let numba find out once what an operation on some types gives, not for every sum anew."""
    resolve, known = typing._resolve_user_function_type, {}

    def resolved(function, args, named, literals=None):
        kind = typing._lookup_global(function) or function
        if named or not isinstance(kind, types.Function):
            return resolve(function, args, named, literals)
        # The type of a function names all that it can be called with.
        key = kind, tuple(args)
        if key not in known:
            known[key] = resolve(function, args, named, literals)
        return known[key]

    typing._resolve_user_function_type = resolved


class _LeanCompiler(CompilerBase):
    """numba's compiler without what kernels do not need: a third of its time."""

    def __init__(self, typing, *others):
        if "_resolve_user_function_type" not in vars(typing):
            _remember(typing)
        super().__init__(typing, *others)

    def define_pipelines(self):
        """Return the passes."""
        passes = PassManager("kernel")
        for one in DefaultPassBuilder.define_nopython_pipeline(self.state).passes:
            if one[0] not in _NEEDLESS:
                passes.add_pass(*one)
        passes.finalize()
        return [passes]


class KernelCompiler(_LeanCompiler):
    """The compiler of kernels that are called from Python, with large parts optimised once."""

    def compile_extra(self, function):
        """Compile into a library that files can keep."""
        library = KernelLibrary(self.state.targetctx, function.__qualname__, function)
        library.enable_object_caching()
        self.state.library = library
        return super().compile_extra(function)


class PartCompiler(_LeanCompiler):
    """The compiler of parts, up to machine code."""

    def __init__(self, typing, target, library, args, return_type, flags, local_types):
        flags.no_compile = flags.no_cpython_wrapper = True
        super().__init__(typing, target, library, args, return_type, flags, local_types)

    def compile_extra(self, function):
        """Compile; the entry is a mere key, by which callers find the part."""
        self.state.library = PartLibrary(self.state.targetctx, "part", function)
        found = super().compile_extra(function)._replace(entry_point=_key())
        known = found.entry_point, found.fndesc, [found.library]
        self.state.targetctx.insert_user_function(*known)
        return found


def rebuilt(target, payload):
    """Return the part that a file keeps, or None where it keeps machine code."""
    (name, kind, code), fndesc, environment, signature, *_ = payload
    if kind != _PART:
        return None
    library = PartLibrary(target, name)
    own, library.large = code
    library.stays_apart = not own
    if own:
        library._final_module = library._shared_module = binding.parse_bitcode(own)
    library._finalized = True
    return compile_result(
        typing_context=target.typing_context,
        target_context=target,
        entry_point=_key(),
        library=library,
        environment=environment,
        fndesc=fndesc,
        signature=signature,
        objectmode=False,
        lifted=(),
    )
