"""Decorators that compile kernels with numba, with common settings.

numba treats a literal number in a call from another kernel as a separate type and compiles the
called kernel once more. In calls of large kernels it is therefore written as ``np.int64(1)``.
"""

import numba

from gearlib.engines.cache import cache_folder

numba.config.CACHE_DIR = cache_folder()
# Kernels need no C wrapper, because no C code calls them.
_NUMBA_OPTIONS = {"cache": True, "fastmath": False, "error_model": "numpy", "nogil": True}
_NUMBA_OPTIONS |= {"no_cfunc_wrapper": True}


def kernel(function):
    """Compile a function with the settings that all kernels share.

    ``fastmath=False``: the order of events depends on the last digits. ``error_model="numpy"``: a
    division by zero gives infinity, which the kernels rely on. ``nogil``: sweeps run in threads.
    """
    return numba.njit(_nrt=True, forceinline=False, **_NUMBA_OPTIONS)(function)


def inlined_kernel(function):
    """Compile a function into its callers, for steps whose calls cost more than their work."""
    return numba.njit(_nrt=True, forceinline=True, **_NUMBA_OPTIONS)(function)


def kernel_without_refcounts(function):
    """Compile a function without reference counts; it must neither create nor return arrays.

    Every access to a tuple of arrays would count one reference up and down, for all threads, which
    costs more than the sums in inner loops. ``_nrt`` and ``forceinline`` are named everywhere,
    because numba passes on options that are not named to the kernels that a kernel calls.
    """
    return numba.njit(_nrt=False, forceinline=False, **_NUMBA_OPTIONS)(function)


def inlined_without_refcounts(function):
    """Compile a function into its callers, without reference counts of arrays."""
    return numba.njit(_nrt=False, forceinline=True, **_NUMBA_OPTIONS)(function)
