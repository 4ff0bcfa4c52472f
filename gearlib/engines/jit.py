"""The settings with which numba compiles every kernel.

numba takes a constant in a call from another kernel for a type of its own, and compiles the called
kernel once more. Before large kernels it is therefore written as ``np.int64(1)``.
"""

import numba

from gearlib.engines.cache import cache_folder

numba.config.CACHE_DIR = cache_folder()
# No kernel is handed to C, so that numba need not write an entry for it.
_SHARED = {"cache": True, "fastmath": False, "error_model": "numpy", "nogil": True}
_SHARED |= {"no_cfunc_wrapper": True}


def kernel(function):
    """Compile `function` with the settings that all kernels share.

    ``fastmath=False``: the order of events depends on the last digits. ``error_model="numpy"``: a
    division by zero gives infinity, which the kernels rely on. ``nogil``: sweeps run in threads.
    """
    return numba.njit(_nrt=True, forceinline=False, **_SHARED)(function)


def inlined(function):
    """Compile `function` into its callers: for steps whose arguments cost more than their work."""
    return numba.njit(_nrt=True, forceinline=True, **_SHARED)(function)


def uncounted(function):
    """Compile `function` without counts of references: it makes and returns no arrays.

    Every access to a tuple of arrays would count one reference up and down, for all threads: in
    inner loops that costs more than the sums. ``_nrt`` and ``forceinline`` are named everywhere,
    because numba passes options that are not named from a kernel to those that it calls.
    """
    return numba.njit(_nrt=False, forceinline=False, **_SHARED)(function)


def woven(function):
    """Compile `function` into its callers, and as `uncounted`."""
    return numba.njit(_nrt=False, forceinline=True, **_SHARED)(function)
