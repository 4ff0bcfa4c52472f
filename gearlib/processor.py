"""Environment variables with which all x86-64 processors with AVX2 run the same machine code.

OpenBLAS, NumPy, numba and the C library choose their code by the processor, and each code rounds
differently. These settings restrict them to the level x86-64-v3 (AVX2, FMA). Jobs of the workflow
and tests have them; other processes need ``env $(python -m gearlib.processor) python``.
"""

import os
import platform
from pathlib import Path

#: Environment variable whose value "native" switches the settings off.
SWITCH_VARIABLE = "GEARLIB_PROCESSOR"
#: Flags in /proc/cpuinfo of the features that x86-64-v3 adds to x86-64-v2.
V3_FEATURES = {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe"}
#: Features beyond x86-64-v3, by the names of all versions of NumPy, which ignores unknown names.
NUMPY_EXCLUDED = "X86_V4,AVX512_ICL,AVX512_SPR,AVX512F,AVX512CD,AVX512_SKX,AVX512_CLX,AVX512_CNL"
#: The same features in a setting of glibc.
GLIBC_EXCLUDED = "glibc.cpu.hwcaps=-AVX512F,-AVX512CD,-AVX512BW,-AVX512DQ,-AVX512VL"


def settings(environment=None, flags=None):
    """Return a dict of the environment variables that make rounding equal on all processors.

    They restrict numerical libraries to the instruction set x86-64-v3 (AVX2 and FMA). The dict is
    empty if the processor lacks it, or if `environment` (by default ``os.environ``) has the value
    "native" of the variable `SWITCH_VARIABLE`. The C library reads the variables when a process
    starts, other libraries when they are loaded. Other settings of the C library in
    "GLIBC_TUNABLES" are preserved. `flags` is the set of processor features, by default of this
    processor.
    """
    environment = os.environ if environment is None else environment
    flags = features() if flags is None else flags
    if environment.get(SWITCH_VARIABLE) == "native" or not flags >= V3_FEATURES:
        return {}
    tunables = environment.get("GLIBC_TUNABLES", "").split(":")
    other_tunables = [tunable for tunable in tunables if tunable and "cpu.hwcaps=" not in tunable]
    return {
        "GLIBC_TUNABLES": ":".join([*other_tunables, GLIBC_EXCLUDED]),
        "NPY_DISABLE_CPU_FEATURES": NUMPY_EXCLUDED,
        # With the name of the processor alone, numba would use all features of the host.
        "NUMBA_CPU_FEATURES": "+avx2,+fma",
        "NUMBA_CPU_NAME": "x86-64-v3",
        "NUMBA_DISABLE_INTEL_SVML": "1",
        # OpenBLAS uses these kernels on Zen processors, too.
        "OPENBLAS_CORETYPE": "Haswell",
        # Rounding errors of matrix products depend on the number of threads.
        "OPENBLAS_NUM_THREADS": "1",
    }


def features():
    """Return the set of features of this processor, such as "avx2"; empty if they are unknown.

    They are known on x86-64 processors under Linux, from the first line "flags" of /proc/cpuinfo.
    """
    if platform.machine() not in ("x86_64", "AMD64"):
        return set()
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return set()
    return next((set(line.split()) for line in lines if line.startswith("flags")), set())


if __name__ == "__main__":
    print(*(f"{name}={value}" for name, value in settings().items()))
