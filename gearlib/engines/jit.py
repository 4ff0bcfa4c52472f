"""Decorators that compile kernels with numba, and the folder of their machine code.

numba notices edits of the file of a function, but not of the modules from which it calls functions.
So the name of the folder contains a hash of all kernel sources, and stale kernels are never loaded.
The folder lies in the user's cache folder, or under ``NUMBA_CACHE_DIR``.
"""

import contextlib
import functools
import gc
import hashlib
import os
import sys
import tempfile
from pathlib import Path

import numba
import numba.extending
from numba.core.event import Listener, register

from gearlib import progress

#: Folders of the files that define kernels.
_KERNEL_FOLDERS = Path(__file__).parent, Path(__file__).parents[1] / "integrators" / "steps"


def source_hash() -> str:
    """Return a hash, 16 hexadecimal digits, of all Python files that may define kernels."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in _KERNEL_FOLDERS for path in folder.rglob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> str:
    """Return the folder of the machine code of the kernels, creating it if needed.

    Its name contains a hash of the sources, so that no outdated code is loaded. If the user's cache
    folder is read-only, it lies in a temporary folder.
    """
    name = f"kernels-{source_hash()}"
    user_cache = os.path.join(os.path.expanduser("~"), ".cache")
    gearlib_cache = os.path.join(os.environ.get("XDG_CACHE_HOME") or user_cache, "gearlib")
    folder = os.path.join(os.environ.get("NUMBA_CACHE_DIR") or gearlib_cache, name)
    try:
        os.makedirs(folder, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        # The user's cache folder is read-only.
        folder = os.path.join(_temporary_folder(), name)
        os.makedirs(folder, exist_ok=True)
    return folder


def _temporary_folder() -> str:
    """Return a folder for temporary files to which no other user can have written.

    Machine code written by another user could be harmful, so a new folder is created if the usual
    folder of gearlib belongs to another user.
    """
    user = os.getuid() if hasattr(os, "getuid") else None
    path = os.path.join(tempfile.gettempdir(), f"gearlib-{user}")
    with contextlib.suppress(OSError):
        os.mkdir(path, mode=0o700)
    # Systems without user numbers (Windows) have a temporary folder for each user.
    if user is None or (os.path.isdir(path) and os.lstat(path).st_uid == user):
        return path
    return tempfile.mkdtemp(prefix="gearlib-")


class _CompilationListener(Listener):
    """Listener of numba that pauses the garbage collector while kernels are compiled.

    The objects that numba creates would cost the collector a tenth of the time. The first
    compilation of a process is also announced. numba compiles in one thread at a time.
    """

    _is_announced = False
    _depth = 0
    _pauses_collector = False

    def on_start(self, event):
        """Pause the collector and say, once per process and if somebody sees it, what takes time.

        `event.data` has the dispatcher of the compiled function. Functions that it calls are
        compiled meanwhile.
        """
        self._depth += 1
        is_kernel = event.data["dispatcher"].py_func.__module__.startswith("gearlib.")
        if self._depth > 1 or not is_kernel:
            return
        self._pauses_collector = gc.isenabled()
        gc.disable()
        if not self._is_announced and progress.is_interactive():
            _CompilationListener._is_announced = True
            text = "gearlib compiles machine code for this kind of model, once: 5 to 40 s ..."
            print(text, file=sys.stderr, flush=True)

    def on_end(self, event):
        """Let the collector continue after the last compiled function."""
        self._depth -= 1
        if self._depth == 0 and self._pauses_collector:
            self._pauses_collector = False
            gc.enable()


register("numba:compile", _CompilationListener())
numba.config.CACHE_DIR = cache_folder()
# Kernels need no C wrapper, because no C code calls them.
_NUMBA_OPTIONS = {"cache": True, "fastmath": False, "error_model": "numpy", "nogil": True}
_NUMBA_OPTIONS |= {"no_cfunc_wrapper": True}


def kernel(function=None, *, refcounts=True):
    """Compile a function that Python calls, with the options that all kernels share.

    ``fastmath=False``: the order of events depends on the last digits. ``error_model="numpy"``: a
    division by zero gives infinity, on which the kernels rely. ``nogil``: sweeps run in threads.

    With ``refcounts=False`` arrays have no reference counts. Each access to a tuple of arrays would
    change a count that all threads share, which costs more than the sums in inner loops. The
    function must then neither create nor return arrays.
    """
    if function is None:
        return functools.partial(kernel, refcounts=refcounts)
    return numba.njit(_nrt=refcounts, forceinline=False, **_NUMBA_OPTIONS)(function)


def kernel_part(function=None, *, refcounts=True, inlined=False, merged=False):
    """Compile a function that kernels call; for Python it remains an ordinary function.

    The code that converts arguments from Python is left out, which takes a quarter of the time that
    compilation takes. With `inlined` the machine code becomes part of the calling function, because
    a call would cost more than the body. With `merged` numba compiles the function only as a part
    of its callers, which saves time for large functions with one or two calls. For `refcounts` see
    `kernel`. All decorators set ``_nrt`` (reference counts) and ``forceinline``, because a function
    inherits unset options from its caller.
    """
    if function is None:
        return functools.partial(kernel_part, refcounts=refcounts, inlined=inlined, merged=merged)
    if merged:
        return numba.njit(inline="always", _nrt=refcounts, **_NUMBA_OPTIONS)(function)
    options = {"_nrt": refcounts, "forceinline": inlined, **_NUMBA_OPTIONS}
    return numba.extending.register_jitable(**options)(function)
