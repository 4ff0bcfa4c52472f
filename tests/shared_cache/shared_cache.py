"""Share compiled kernels between all copies of the project that tests make.

By default, numba names the cache folder of a function by the path of its file, so that each copy of
the project would compile all kernels again. NUMBA_CACHE_LOCATOR_CLASSES selects this class instead.
"""

from pathlib import Path

from numba.core.caching import UserProvidedCacheLocator


class SharedLocator(UserProvidedCacheLocator):
    """Locate the cache of a kernel by the name of its package instead of its path."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file):
        """Return the cache folder of a file: for kernels of gearlib, the name of their package."""
        folder = Path(py_file).parent
        if "engines" in folder.parts or folder.name == "steps":
            return folder.name
        return super().get_suitable_cache_subpath(py_file)
