"""The folder in which numba keeps the machine code of the kernels.

numba looks for edits in the file of a function only, not in the modules whose functions it calls.
So the folder carries a hash of all kernel sources in its name, and a stale kernel cannot be loaded.
It lies in the user's cache folder, or under ``NUMBA_CACHE_DIR``.
"""

import contextlib
import hashlib
import os
import tempfile
from pathlib import Path

_KERNELS = Path(__file__).parent, Path(__file__).parents[1] / "integrators" / "steps"


def source_hash():
    """Return a hash (16 hex digits) of all kernel sources."""
    digest = hashlib.sha256()
    for path in sorted(path for folder in _KERNELS for path in folder.rglob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cache_folder():
    """Return the folder of the machine code, which is created if needed."""
    name = f"kernels-{source_hash()}"
    home = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    base = os.environ.get("NUMBA_CACHE_DIR") or os.path.join(home, "gearlib")
    folder = os.path.join(base, name)
    try:
        os.makedirs(folder, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        # The home folder is read-only.
        folder = os.path.join(_temporary_folder(), name)
        os.makedirs(folder, exist_ok=True)
    return folder


def _temporary_folder():
    """Return a folder for temporary files that no other user can have filled."""
    user = os.getuid() if hasattr(os, "getuid") else None
    path = os.path.join(tempfile.gettempdir(), f"gearlib-{user}")
    with contextlib.suppress(OSError):
        os.mkdir(path, mode=0o700)
    if user is None or (os.path.isdir(path) and os.lstat(path).st_uid == user):
        return path
    return tempfile.mkdtemp(prefix="gearlib-")
