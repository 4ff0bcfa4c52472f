"""How every kernel is compiled."""

import gc
from contextlib import contextmanager
from functools import cache

import numba
from numba import njit, types

from gearlib.kernels.cache import KernelCache
from gearlib.kernels.kernel_parts import KernelCompiler, PartCompiler


@contextmanager
def _uncollected():
    # What a compiler leaves behind is looked through again and again: a fifth of its time.
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()


def _compile(function, **options):
    # No kernel is handed over as a function of C.
    # Options not named are those of the kernel that calls first: the code would hang on the order.
    options = {"forceinline": False} | options
    options |= {"fastmath": False, "error_model": "numpy", "nogil": True, "no_cfunc_wrapper": True}
    compiled = njit(pipeline_class=KernelCompiler, **options)(function)
    if numba.config.DISABLE_JIT:
        return function
    # What `cache=True` would do, with another cache.
    compiled._cache = KernelCache(function)
    compiled.compile = _uncollected()(compiled.compile)

    @cache
    def part():
        found = njit(pipeline_class=PartCompiler, **options)(function)
        found._cache = KernelCache(function, ".part")
        return found

    # numba compiles a kernel again for each constant in a call from another kernel, as a type of
    # its own, and the code is the same: a third of all compilation.
    compiled.get_call_template = lambda arguments, named: part().get_call_template(
        [types.unliteral(kind) for kind in arguments],
        {name: types.unliteral(kind) for name, kind in named.items()},
    )
    compiled.get_overload = lambda signature: part().get_overload(signature)
    return compiled


def kernel(function):
    """Compile `function` with the settings that all kernels share.

    ``fastmath=False``: the order of events hangs on the last digits. ``error_model="numpy"``: a
    division by zero gives infinity, which the kernels rely on. ``nogil``: sweeps run in threads.
    """
    return _compile(function, _nrt=True)


def inlined(function):
    """Compile `function` into its callers: for steps whose arguments cost more than their work."""
    return _compile(function, _nrt=True, forceinline=True)


def uncounted(function):
    """Compile `function` without counts of references: it makes and returns no arrays.

    Every look into a tuple of arrays would count one reference up and down, for all threads: in
    inner loops that costs more than the sums. (``_nrt`` stands everywhere: numba would pass it on
    from a kernel to those that it calls.)
    """
    return _compile(function, _nrt=False)


def woven(function):
    """Compile `function` into its callers, and as `uncounted`."""
    return _compile(function, _nrt=False, forceinline=True)
