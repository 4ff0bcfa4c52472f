"""A process of the workflow on another processor than this one, and which one its libraries took.

What a processor lacks, libraries cannot use; what else they choose by it is chosen here where the
environment leaves it open, in each process anew, before it loads anything. ``GEARLIB_EMULATED``
holds such choices as JSON. {"qemu": name of a processor} has QEMU run the jobs instead, whose CPUID
is then that of the other processor, to all libraries: slow, and no pretence.
"""

import ctypes
import json
import os
import shutil
import sys
from pathlib import Path

#: Names that OpenBLAS of numpy and of scipy gives its function.
_CORE = [f"{start}openblas_get_corename{end}" for start in ("scipy_", "") for end in ("64_", "")]


def begin():
    """Become the processor of ``GEARLIB_EMULATED``, if there is one."""
    choices = json.loads(os.environ.get("GEARLIB_EMULATED", "{}"))
    inside = os.environ.get("GEARLIB_INSIDE") == str(os.getpid())
    if "qemu" in choices:
        if not inside and ".snakemake/scripts" in " ".join(sys.orig_argv):
            os.environ["GEARLIB_INSIDE"] = str(os.getpid())
            command = [shutil.which("qemu-x86_64"), "-cpu", choices["qemu"], sys.executable]
            os.execv(command[0], [*command, *sys.orig_argv[1:]])
        return
    lacking = choices.pop("NPY_DISABLE_CPU_FEATURES", "")
    if lacking:
        named = os.environ.get("NPY_DISABLE_CPU_FEATURES", "")
        named = dict.fromkeys(f"{named},{lacking}".strip(",").split(","))
        os.environ["NPY_DISABLE_CPU_FEATURES"] = ",".join(named)
    for name, value in choices.items():
        os.environ.setdefault(name, value)


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
