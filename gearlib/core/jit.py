"""How every kernel is compiled, and where its machine code is kept.

numba's own cache looks at the file of a function only and misses edits in the modules it
calls. Here the cache directory carries a hash of all kernel sources, so that a stale kernel
cannot be loaded. It lies in the user's cache folder (or under ``NUMBA_CACHE_DIR``), outside the
checkout.
"""

import hashlib
import os
import tempfile
from pathlib import Path

import numba
from numba import njit
from numba.core.caching import UserProvidedCacheLocator


def source_hash():
    """Return the hash (16 hex digits) of all kernel sources."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_directory():
    base = os.environ.get("NUMBA_CACHE_DIR")
    if base is None:
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        base = os.path.join(cache, "gearlib")
    directory = os.path.join(base, f"kernels-{source_hash()}")
    try:
        os.makedirs(directory, exist_ok=True)
    except OSError:
        # A read-only home must not keep anyone from computing.
        directory = os.path.join(tempfile.gettempdir(), f"gearlib-kernels-{source_hash()}")
    return directory


_DIRECTORY = _cache_directory()


class SharedLocator(UserProvidedCacheLocator):
    """numba's folder given by the user, without its subfolder for the path of the checkout.

    The name of the folder says which sources it belongs to, so that every checkout of the same
    sources shares their machine code.
    """

    @classmethod
    def get_suitable_cache_subpath(cls, py_file):
        """Return the subfolder for a source file: that of its package."""
        return Path(py_file).parent.name


def _compile(function, **options):
    # numba reads the directory when it decorates; it is put back so that the
    # caller's own kernels stay where the caller wants them.
    before = numba.config.CACHE_DIR, numba.config.CACHE_LOCATOR_CLASSES
    numba.config.CACHE_DIR = _DIRECTORY
    numba.config.CACHE_LOCATOR_CLASSES = f"{__name__}.{SharedLocator.__name__}"
    try:
        return njit(cache=True, fastmath=False, error_model="numpy", nogil=True, **options)(
            function
        )
    finally:
        numba.config.CACHE_DIR, numba.config.CACHE_LOCATOR_CLASSES = before


def kernel(function):
    """Compile `function` with the settings that all kernels share.

    ``fastmath=False``: the order of events hangs on the last digits. ``error_model="numpy"``: a
    division by zero gives infinity, which the kernels rely on. ``nogil``: sweeps run in threads.
    """
    return _compile(function)


def inlined(function):
    """Compile `function` into its callers: for steps whose arguments cost more than their work."""
    return _compile(function, forceinline=True)
