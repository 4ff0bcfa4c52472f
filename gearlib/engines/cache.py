"""The folder in which numba keeps the machine code of the kernels.

numba notices edits of the file of a function, but not of the modules from which it calls functions.
So the name of the folder contains a hash of all kernel sources, and stale kernels are never loaded.
The folder lies in the user's cache folder, or under ``NUMBA_CACHE_DIR``.
"""

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

#: Folders of the files that define kernels.
_KERNEL_FOLDERS = Path(__file__).parent, Path(__file__).parents[1] / "integrators" / "steps"


def source_hash() -> str:
    """Return a hash, 16 hex digits, of all Python files in the folders with kernels."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in _KERNEL_FOLDERS for path in folder.rglob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder() -> str:
    """Return the folder of the kernels' machine code; create it if needed."""
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
    """Return a folder for temporary files to which no other user can have written."""
    user = os.getuid() if hasattr(os, "getuid") else None
    path = os.path.join(tempfile.gettempdir(), f"gearlib-{user}")
    with contextlib.suppress(OSError):
        os.mkdir(path, mode=0o700)
    if user is None or (os.path.isdir(path) and os.lstat(path).st_uid == user):
        return path
    return tempfile.mkdtemp(prefix="gearlib-")
