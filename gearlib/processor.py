"""The same machine code on every x86-64 processor with AVX2: settings for a process to be started.

OpenBLAS, NumPy, numba and the C library each choose their code by the processor, and the codes
round differently. Under these settings all of them take what the level x86-64-v3 (AVX2, FMA) has,
which every such processor runs. Jobs of the workflow and tests have them; whoever imports the
library has native code, unless Python is started by ``env $(python -m gearlib.processor) python``.

Left out where they do not apply: on processors below that level or of another kind, where Linux
does not say, and where ``GEARLIB_PROCESSOR=native`` is set.
"""

import os
import platform
from pathlib import Path

#: Switches the settings off, with the value "native".
SWITCH = "GEARLIB_PROCESSOR"

#: What Linux calls the features of x86-64-v3 beyond the level before it.
LEVEL = {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}

#: What goes beyond the level, by the names of NumPy from 2.4 on, and of those before. Of a name
#: that it does not know, or that the machine lacks, NumPy says so in an ImportWarning, which Python
#: shows to nobody who has not asked for it.
NUMPY = "X86_V4 AVX512_ICL AVX512_SPR AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL"

#: The same by the names of glibc, whose loader also prefers libraries built for x86-64-v4.
GLIBC = "AVX512F AVX512CD AVX512BW AVX512DQ AVX512VL"

_GLIBC = "glibc.cpu.hwcaps="


def settings(environment=None, flags=None):
    """Return the environment variables, a dict; empty where they do not apply.

    They are read when a library is loaded, those of the C library when a process starts. By default
    the environment is ``os.environ``, whose tunables of glibc are kept, and the flags are features
    of this processor as in ``/proc/cpuinfo``.
    """
    environment = os.environ if environment is None else environment
    flags = features() if flags is None else flags
    if environment.get(SWITCH) == "native" or not flags >= LEVEL:
        return {}
    tunables = environment.get("GLIBC_TUNABLES", "").split(":")
    others = [one for one in tunables if one and not one.startswith(_GLIBC)]
    masks = _GLIBC + ",".join(f"-{name}" for name in GLIBC.split())
    return {
        "GLIBC_TUNABLES": ":".join([*others, masks]),
        "NPY_DISABLE_CPU_FEATURES": NUMPY.replace(" ", ","),
        # The name alone would leave numba all features of the host.
        "NUMBA_CPU_FEATURES": "+avx2,+fma",
        "NUMBA_CPU_NAME": "x86-64-v3",
        # Intel's vector functions, if they are installed.
        "NUMBA_DISABLE_INTEL_SVML": "1",
        # The kernels of Zen are the same.
        "OPENBLAS_CORETYPE": "Haswell",
        # Products of matrices are cut by the number of threads, thus of cores.
        "OPENBLAS_NUM_THREADS": "1",
    }


def features():
    """Return the features of this processor, a set of str; none where Linux does not say."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return set()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())


if __name__ == "__main__":
    print(*(f"{name}={value}" for name, value in settings().items()))
