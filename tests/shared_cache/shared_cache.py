"""Machine code for all copies of the project that tests make: numba's folders without its path.

numba names the folder of a function by the path of its file, and every copy of the project would
compile all kernels anew. Its setting NUMBA_CACHE_LOCATOR_CLASSES takes this class instead.
"""

from pathlib import Path

from numba.core.caching import UserProvidedCacheLocator


class SharedLocator(UserProvidedCacheLocator):
    """A folder of the cache by the name of the package that a function lies in."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file):
        """Return the name of the cache folder; kernels of gearlib use the name of their folder."""
        folder = Path(py_file).parent
        if "engines" in folder.parts or folder.name == "steps":
            return folder.name
        return super().get_suitable_cache_subpath(py_file)
