"""How every kernel is compiled."""

import numba
from numba import njit

from gearlib.kernels.cache import KernelCache


def _compile(function, **options):
    compiled = njit(fastmath=False, error_model="numpy", nogil=True, **options)(function)
    if not numba.config.DISABLE_JIT:
        # What `cache=True` would do, with another cache.
        compiled._cache = KernelCache(function)
    return compiled


def kernel(function):
    """Compile `function` with the settings that all kernels share.

    ``fastmath=False``: the order of events hangs on the last digits. ``error_model="numpy"``: a
    division by zero gives infinity, which the kernels rely on. ``nogil``: sweeps run in threads.
    """
    return _compile(function)


def inlined(function):
    """Compile `function` into its callers: for steps whose arguments cost more than their work."""
    return _compile(function, forceinline=True)
