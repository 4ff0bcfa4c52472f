"""What gear geometry costs: geometry and stiffness of one mesh in a fresh process, import apart.

Nothing of it is compiled, so the first call is what a user waits for.
"""

import subprocess
import sys

from benchmarks.short import repeats

REPEATS = repeats(5)

#: FZG type C.
CODE = """
import sys
from time import process_time
from gearlib.geometry import GearStage, SpurGear
start = process_time()
common = {"module": 4.5e-3, "width": 14e-3, "bore": 30e-3}
pinion = SpurGear(teeth=16, shift=0.1817, tip_diameter=82.46e-3, **common)
wheel = SpurGear(teeth=24, shift=0.1715, tip_diameter=118.36e-3, **common)
mesh = GearStage(pinion, wheel, 91.5e-3)
mesh.stiffness(%s)
print(process_time() - start)
assert "numba" not in sys.modules
"""

CASES = {
    "ISO 6336-1": "'iso'",
    "energy method": "'energy'",
    "energy method, logarithmic contact": "'energy', hertz='logarithmic', torque=302.0",
}


def first(arguments):
    """Return the processor seconds of the first stiffness of a process, the least of several."""
    command = [sys.executable, "-c", CODE % arguments]
    runs = [subprocess.run(command, check=True, capture_output=True) for _ in range(REPEATS)]
    return min(float(run.stdout) for run in runs)


def rows():
    """Return rows (name, value, unit)."""
    return [
        (f"fresh process, a stage and its first stiffness, {name}", 1e3 * first(code), "ms")
        for name, code in CASES.items()
    ]


if __name__ == "__main__":
    for name, value, unit in rows():
        print(f"{name:80s} {value:10.3g} {unit}")
