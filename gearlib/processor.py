"""Environment variables that give every x86-64 processor with AVX2 the same machine code.

OpenBLAS, NumPy, numba and the C library each choose their code by the processor, and the codes
round differently. These settings keep all of them at the level x86-64-v3 (AVX2, FMA). Jobs of the
workflow and tests have them; other processes need ``env $(python -m gearlib.processor) python``.
"""

import os
import platform
from pathlib import Path

#: Switches the settings off, with the value "native".
SWITCH = "GEARLIB_PROCESSOR"
#: Flags in /proc/cpuinfo of the features of x86-64-v3 beyond the level before it.
LEVEL = {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
#: Features beyond the level by the names of NumPy from 2.4 on and of those before; NumPy ignores
#: the names that it does not know.
NUMPY = "X86_V4,AVX512_ICL,AVX512_SPR,AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL"
#: The same by the names of glibc, whose loader also prefers libraries built for x86-64-v4.
GLIBC = "glibc.cpu.hwcaps=-AVX512F,-AVX512CD,-AVX512BW,-AVX512DQ,-AVX512VL"


def settings(environment=None, flags=None):
    """Return the environment variables, a dict; empty on other processors or where switched off.

    Libraries read them when they are loaded, glibc when the process starts. `environment`, by
    default ``os.environ``, keeps its other tunables of glibc; `flags`, by default those of this
    processor, are its features.
    """
    environment = os.environ if environment is None else environment
    flags = features() if flags is None else flags
    if environment.get(SWITCH) == "native" or not flags >= LEVEL:
        return {}
    tunables = environment.get("GLIBC_TUNABLES", "").split(":")
    others = [tunable for tunable in tunables if tunable and "cpu.hwcaps=" not in tunable]
    return {
        "GLIBC_TUNABLES": ":".join([*others, GLIBC]),
        "NPY_DISABLE_CPU_FEATURES": NUMPY,
        # The name alone would leave numba all features of the host.
        "NUMBA_CPU_FEATURES": "+avx2,+fma",
        "NUMBA_CPU_NAME": "x86-64-v3",
        "NUMBA_DISABLE_INTEL_SVML": "1",
        # OpenBLAS has the same kernels for Zen.
        "OPENBLAS_CORETYPE": "Haswell",
        # OpenBLAS cuts products of matrices by the number of threads.
        "OPENBLAS_NUM_THREADS": "1",
    }


def features():
    """Return the features of this processor, a set of str; empty where Linux does not tell."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return set()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())


if __name__ == "__main__":
    print(*(f"{name}={value}" for name, value in settings().items()))
