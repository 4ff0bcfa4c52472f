"""Kernels as parts of those that call them: without machine code of their own.

numba makes machine code of each kernel together with all that it calls, so that a kernel at the
bottom is translated once for every one above it. A part is optimised only: who is
called from Python takes it in and translates all at once.
"""

from llvmlite import binding
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, compile_result

#: Kind of what `PartLibrary.serialize_using_object_code` gives, beside numba's own.
_PART = "part"


def _key():
    # numba takes nothing but a built-in function, and no two may be equal.
    return object().__dir__


class PartLibrary(JITCodeLibrary):
    """The code of one kernel and of the parts that it calls."""

    def finalize(self):
        """Take in what the kernel calls, and optimise."""
        self._raise_if_finalized()
        for library in dict.fromkeys(self._linking_libraries):
            self._reload_init.update(library._reload_init)
            self._final_module.link_in(library._get_module_for_linking(), preserve=True)
        # Optimised in its callers only, Taylor steps were 7 % slower, trains up to 20 %.
        self._optimize_final_module()
        self._finalized = True

    def serialize_using_object_code(self):
        """Return what a file keeps of it: there is no object code."""
        self._ensure_finalized()
        return self.name, _PART, self._get_module_for_linking().as_bitcode()


class PartCompiler(Compiler):
    """numba's compiler up to machine code."""

    def __init__(self, typing, target, library, args, return_type, flags, local_types):
        flags.no_compile = flags.no_cpython_wrapper = True
        library = PartLibrary(target.codegen(), "part")
        super().__init__(typing, target, library, args, return_type, flags, local_types)

    def compile_extra(self, function):
        """Compile; the entry is a mere key, by which callers find the part."""
        found = super().compile_extra(function)._replace(entry_point=_key())
        known = found.entry_point, found.fndesc, [found.library]
        self.state.targetctx.insert_user_function(*known)
        return found


def rebuilt(target, payload):
    """Return the part that a file keeps, or None where it keeps machine code."""
    (name, kind, code), fndesc, environment, signature, *_ = payload
    if kind != _PART:
        return None
    library = PartLibrary(target.codegen(), name)
    library._final_module = library._shared_module = binding.parse_bitcode(code)
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
