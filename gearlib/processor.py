"""Environment variables that make all x86-64 processors with AVX2 run the same machine code.

OpenBLAS, NumPy, numba and the C library select code for the processor, and each variant rounds
differently. These variables restrict them to the level x86-64-v3 (AVX2, FMA). Jobs of the workflow
and tests set them; other processes need ``env $(python -m gearlib.processor) python``.
"""

import os
import platform
from pathlib import Path

#: Environment variable whose value "native" disables the restriction.
SWITCH_VARIABLE = "GEARLIB_PROCESSOR"
#: Flags in /proc/cpuinfo for the features that x86-64-v3 adds to x86-64-v2.
V3_FEATURES = {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
#: Features beyond x86-64-v3, as named by all NumPy versions, which ignore unknown names.
NUMPY_EXCLUDED = "X86_V4,AVX512_ICL,AVX512_SPR,AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL"
#: The same features as a tunable of glibc.
GLIBC_EXCLUDED = "glibc.cpu.hwcaps=-AVX512F,-AVX512CD,-AVX512BW,-AVX512DQ,-AVX512VL"


def environment_variables(environment=None, flags=None):
    """Return environment variables that make results round equally on all processors, as a dict.

    They restrict numerical libraries to the instruction set x86-64-v3 (AVX2 and FMA). The C library
    reads them when a process starts, the other libraries when they are loaded. The dict is empty if
    `SWITCH_VARIABLE` is "native" in `environment`, or if the processor lacks this instruction set.

    `environment` is ``os.environ`` by default; its other glibc tunables are preserved. `flags` is
    the set of processor features, by default those of this processor.
    """
    environment = os.environ if environment is None else environment
    flags = cpu_features() if flags is None else flags
    if environment.get(SWITCH_VARIABLE) == "native" or not flags >= V3_FEATURES:
        return {}
    tunables = environment.get("GLIBC_TUNABLES", "").split(":")
    other_tunables = [tunable for tunable in tunables if tunable and "cpu.hwcaps=" not in tunable]
    return {
        "GLIBC_TUNABLES": ":".join([*other_tunables, GLIBC_EXCLUDED]),
        "NPY_DISABLE_CPU_FEATURES": NUMPY_EXCLUDED,
        # If only the processor name were set, numba would use all features of the host.
        "NUMBA_CPU_FEATURES": "+avx2,+fma",
        "NUMBA_CPU_NAME": "x86-64-v3",
        "NUMBA_DISABLE_INTEL_SVML": "1",
        # OpenBLAS uses these kernels on Zen processors, too.
        "OPENBLAS_CORETYPE": "Haswell",
        # Rounding errors of matrix products depend on the number of threads.
        "OPENBLAS_NUM_THREADS": "1",
    }


def cpu_features():
    """Return the features of this processor, such as "avx2", as a set; empty if they are unknown.

    They are read from /proc/cpuinfo, on x86-64 processors under Linux only.
    """
    if platform.machine() not in ("x86_64", "AMD64"):
        return set()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())


if __name__ == "__main__":
    print(*(f"{name}={value}" for name, value in environment_variables().items()))
