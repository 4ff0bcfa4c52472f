"""The workflow on other processors, byte by byte: `make same-bytes`.

The small workflow of the tests, or with ``--full`` that of `config.yaml`, from nothing: on this
processor, then on others, see `recorder/emulated.py`; at last on some of them without the settings
of `gearlib.processor`, where bytes have to differ, or nothing was emulated. Files of wall times,
and what is made of them, are left out.
"""

import argparse
import contextlib
import json
import os
import shutil
import sys
import tempfile
from pathlib import Path
from unittest import mock

from gearlib import processor
from tests.workflow.project import ROOT, small_project

RECORDER = ROOT / "tests/workflow/recorder"

_NO_AVX512 = {"NPY_DISABLE_CPU_FEATURES": "X86_V4,AVX512_ICL,AVX512_SPR"}

#: What libraries choose by themselves on processors with AVX2. OpenBLAS takes an old kernel for
#: makers that it does not know.
EMULATED = {
    "Skylake-X": {"OPENBLAS_CORETYPE": "SkylakeX", "NUMBA_CPU_NAME": "skylake-avx512"},
    "Zen 2": {"OPENBLAS_CORETYPE": "ZEN", "NUMBA_CPU_NAME": "znver2"} | _NO_AVX512,
    "unknown": {"OPENBLAS_CORETYPE": "Nehalem", "NUMBA_CPU_NAME": "haswell"} | _NO_AVX512,
}

#: Models of QEMU with AVX2, of both makers.
QEMU = {name: {"qemu": name} for name in ("Haswell-noTSX", "EPYC")}


def unset():
    """Return the emulated processors, name -> choices, whose bytes differ without the settings.

    Zen's kernels are those of the settings; to run those of Skylake-X a processor needs AVX-512.
    Machine code of the settings' one target is at hand: kernels need not be compiled anew.
    """
    kept = {name: value for name, value in processor.settings().items() if "NUMBA_CPU" in name}
    names = ["Skylake-X", "unknown"] if "avx512f" in processor.features() else ["unknown"]
    return {name: EMULATED[name] | kept for name in names}


@contextlib.contextmanager
def recorded(records, choices=None, settings=True):
    """Have processes write what they took into the folder `records`, on an emulated processor.

    Without `settings` those of `gearlib.processor` are switched off.
    """
    records.mkdir(parents=True)
    path = os.pathsep.join(filter(None, [str(RECORDER), os.environ.get("PYTHONPATH")]))
    changes = {"GEARLIB_RECORDS": str(records), "PYTHONPATH": path}
    changes["GEARLIB_EMULATED"] = json.dumps(choices or {})
    with mock.patch.dict(os.environ, changes):
        if not settings:
            for name in processor.settings():
                os.environ.pop(name, None)
            os.environ[processor.SWITCH] = "native"
        yield


def read(records):
    """Return the records of the jobs, a list of dicts."""
    found = (json.loads(path.read_text(encoding="utf-8")) for path in records.glob("*.json"))
    return [record for record in found if record["rule"]]


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


def timed(jobs):
    """Return the files that hold wall times or are made of such."""
    found = {path for job in jobs for path in job["written"] if Path(path).name.startswith("times")}
    known = set()
    while found != known:
        known = set(found)
        found |= {path for job in jobs if known & {*job["read"]} for path in job["written"]}
    return found


def differing(first, second, apart=()):
    """Return the paths of the files that are not the same in two `Project.results`."""
    names = sorted({*first, *second} - {*apart})
    return [name for name in names if first.get(name) != second.get(name)]


def main():
    program = "python -m tests.workflow.same_bytes"
    parser = argparse.ArgumentParser(prog=program, description=__doc__)
    known = EMULATED | (QEMU if shutil.which("qemu-x86_64") else {})
    off = {f"{name}, settings off": choices for name, choices in unset().items()}
    names = [*known, *off]
    parser.add_argument("names", nargs="*", help=f"by default all: {'; '.join(names)}")
    parser.add_argument("--full", action="store_true", help="the configuration of config.yaml")
    parser.add_argument("--jobs", default=str(os.cpu_count()), help="at the same time")
    parser.add_argument("--target", action="append", help="file of results; by default all")
    given = parser.parse_args()
    if set(given.names) - set(names):
        parser.error(f"processors {given.names} are not allowed: they must be of {names}")
    if not processor.settings():
        parser.error("this processor has no settings, see gearlib/processor.py")
    runs = {"this processor": {}} | known | off
    runs = {name: runs[name] for name in ["this processor", *(given.names or names)]}
    first, apart, failed = None, set(), False
    with tempfile.TemporaryDirectory() as folder:
        for number, (name, choices) in enumerate(runs.items()):
            settings = name not in off
            records = Path(folder) / f"records{number}"
            project = small_project(Path(folder) / f"{number}")
            if given.full:
                shutil.copy2(ROOT / "config.yaml", project / "config.yaml")
            with recorded(records, choices, settings):
                project.snakemake(f"-j{given.jobs}", *(given.target or []))
            jobs, found = read(records), project.results()
            apart |= timed(jobs)
            first = found if first is None else first
            moved, took = differing(first, found, apart), others(jobs) if settings else []
            failed |= bool(took) or bool(moved) == settings and first is not found
            counts = f"{len(jobs)} jobs, {len(moved)} of {len(found)} files differ"
            print(f"{name}: {counts}", flush=True)
            print(*moved, *took, sep="\n", end="\n" if moved or took else "", flush=True)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
