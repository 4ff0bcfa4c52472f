"""The code that libraries of a process chose by the processor, against `gearlib.processor`."""

import ctypes
import sys
from pathlib import Path

#: Names that OpenBLAS of numpy and of scipy gives its function.
_CORE = [f"{start}openblas_get_corename{end}" for start in ("scipy_", "") for end in ("64_", "")]


def taken():
    """Return what the libraries that this process has loaded took: name -> text or list."""
    found = {}
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    for path in sorted({line.split()[-1] for line in maps if "openblas" in line}):
        library = ctypes.CDLL(path)
        (core,) = [getattr(library, name) for name in _CORE if hasattr(library, name)][:1]
        core.restype = ctypes.c_char_p
        found[f"OpenBLAS of {Path(path).parent.name}"] = core().decode()
    numpy = sys.modules.get("numpy._core._multiarray_umath")
    if numpy:
        features = numpy.__cpu_features__
        found["numpy"] = [name for name in numpy.__cpu_dispatch__ if features[name]]
    if "numba.core.registry" in sys.modules:
        codegen = sys.modules["numba.core.registry"].cpu_target.target_context.codegen()
        found["numba"] = [*codegen.magic_tuple()[1:]]
    # As it stood when the process began: the C library has read it then.
    begun = Path("/proc/self/environ").read_text(encoding="utf-8").split("\0")
    found["glibc"] = [one.partition("=")[2] for one in begun if one.startswith("GLIBC_TUNABLES=")]
    return found


def others(jobs):
    """Return a sentence for each job in which a library took other code than the settings'."""
    sentences = []
    for job in jobs:
        for library, taken in job["processor"].items():
            if library.startswith("OpenBLAS"):
                right = taken == "Haswell"
            elif library == "numba":
                right = taken == ["x86-64-v3", "+avx2,+fma"]
            elif library == "numpy":
                right = not [name for name in taken if name == "X86_V4" or "AVX512" in name]
            else:
                right = "-AVX512F," in "".join(taken)
            if not right:
                sentences.append(f"{job['rule']}: {library} took {taken}")
    return sentences
