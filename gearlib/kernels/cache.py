"""Where the machine code of the kernels is kept: safe for many processes, nodes and checkouts.

numba's own cache looks at the file of a function only and misses edits in the modules it
calls. Here the folder carries a hash of all kernel sources, so that a stale kernel cannot be
loaded; a kernel outside of this package, which may call these and those of its own file, has a
folder inside with a hash of that file. All lies in the user's cache folder (or under
``NUMBA_CACHE_DIR``), outside the checkout, and serves every checkout of the same sources. A folder
that no process has begun to use for a month goes when a new one is made: whoever still runs
compiles what it has not loaded yet.

numba also keeps an index of its files, which it reads, changes and writes back: two processes that
save the same function for different arguments, or for the processors of two nodes with one home,
can give both entries one file, and one of them then runs the code of the other. Here there is no
index: the name of a file is a hash of all that its code depends on, and a file appears whole.
Whoever comes second writes the same code once more.

The first call of a new version compiles for up to a minute: a line on the terminal, or in a
notebook, says so, once in a process.
"""

import contextlib
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

import numba
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    UserProvidedCacheLocator,
)

from gearlib.kernels.kernel_parts import rebuilt

_CORE = Path(__file__).parent
_MONTH = 30 * 24 * 3600.0


def source_hash():
    """Return the hash (16 hex digits) of all kernel sources."""
    digest = hashlib.sha256()
    for path in sorted(_CORE.rglob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _folder():
    name = f"kernels-{source_hash()}"
    base = os.environ.get("NUMBA_CACHE_DIR")
    if base is None:
        cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
        base = os.path.join(cache, "gearlib")
    folder = os.path.join(base, name)
    try:
        if not os.path.isdir(folder):
            os.makedirs(folder, exist_ok=True)
            remove_unused(base)
    except OSError:
        # A read-only home must not keep anyone from computing.
        folder = os.path.join(_temporary_folder(), name)
    with contextlib.suppress(OSError):
        os.utime(folder)
    return folder


def remove_unused(base, now=None):
    """Remove the folders of machine code below `base` that no process has used for a month.

    Parameters
    ----------
    base : str or os.PathLike
        Other files and folders there are left alone.
    now : float, optional
        Seconds since the epoch; by default the clock's.
    """
    oldest = (time.time() if now is None else now) - _MONTH
    for path in Path(base).iterdir():
        # Whatever cannot be looked at or removed, another process's or another user's, stays.
        with contextlib.suppress(OSError):
            if re.fullmatch("kernels-[0-9a-f]{16}", path.name) and path.stat().st_mtime < oldest:
                shutil.rmtree(path, ignore_errors=True)


def _temporary_folder():
    """Return a folder for temporary files that nobody else can have filled."""
    user = os.getuid() if hasattr(os, "getuid") else None
    path = os.path.join(tempfile.gettempdir(), f"gearlib-{user}")
    with contextlib.suppress(OSError):
        os.mkdir(path, mode=0o700)
    if user is None or (os.path.isdir(path) and os.lstat(path).st_uid == user):
        return path
    return tempfile.mkdtemp(prefix="gearlib-")


_FOLDER = _folder()


class _Locator(UserProvidedCacheLocator):
    """The folder of a kernel: that of its package, the same for every checkout."""

    def __init__(self, py_func, py_file):
        self._py_file = py_file
        self._lineno = py_func.__code__.co_firstlineno
        path = Path(py_file)
        folder = path.parent.name
        if not path.is_relative_to(_CORE):
            folder += "-" + hashlib.sha256(path.read_bytes()).hexdigest()[:16]
        self._cache_path = os.path.join(_FOLDER, folder)

    @classmethod
    def from_function(cls, py_func, py_file):
        """Return the locator of a kernel, whether or not anything can be written."""
        return cls(py_func, py_file)

    def ensure_cache_path(self):
        """Make the folder, if it can be made."""
        with contextlib.suppress(OSError):
            os.makedirs(self._cache_path, exist_ok=True)


class _Naming(CompileResultCacheImpl):
    _locator_classes = [_Locator]

    def rebuild(self, target_context, payload):
        return rebuilt(target_context, payload) or super().rebuild(target_context, payload)


@cache
def _say_that_this_compiles():
    """Tell, once, whoever waits for the machine code that is not there yet."""
    waiting = sys.stderr is not None and sys.stderr.isatty() or "ipykernel" in sys.modules
    if waiting:
        print("gearlib compiles, once for this version: up to a minute", file=sys.stderr)


class KeyedFiles(IndexDataCacheFile):
    """Machine code of one function: a file for each key, found by the hash in its name.

    A key holds the argument types, the processor with its features, and the function's bytecode.
    """

    def save(self, key, data):
        """Save machine code; without room or permission it is merely compiled again next time."""
        with contextlib.suppress(OSError):
            self._save_data(self._file_name(key), (key, data))

    def load(self, key):
        """Return the machine code of a key, or None."""
        try:
            stored, data = self._load_data(self._file_name(key))
        except Exception:
            # No such file, or one that a dying disk or node has cut short: what a damaged pickle
            # raises can be anything, and the kernel can always be compiled.
            _say_that_this_compiles()
            return None
        return data if stored == key else None

    def _file_name(self, key):
        digest = hashlib.sha256(repr((numba.__version__, key)).encode()).digest()
        return self._data_name(int.from_bytes(digest[:8], "big"))


class KernelCache(FunctionCache):
    """numba's cache of one function, over `KeyedFiles`."""

    _impl_class = _Naming

    def __init__(self, py_func, suffix=""):
        super().__init__(py_func)
        self._cache_file = KeyedFiles(self.cache_path, self._impl.filename_base + suffix, None)
