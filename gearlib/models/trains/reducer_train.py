"""The paper's machine, its Fig. 1 a: three double satellites between two central gears.

Hortel & Skuderova, Engineering Mechanics 14 (2007) 91-104, name a pseudoplanetary reducer with
three double satellites and split power flow; they print no number of it beyond those of one mesh.
All others are choices, stated here:

* teeth 24 : 36 in the first stage, 24 : 36 (external) or 24 : 84 (internal second central gear) in
  the second, of one module of 4 mm: equal centre distances, the branches in phase, and three
  periods of the first mesh to two of the second;
* the pair of the paper, `GearPair`, as every mesh: its load on each first mesh, its reduced mass as
  that of the first mesh without its neighbours, with I / r^2 in proportion to z^2, and gears twice
  as heavy, 2 I / r^2, as discs are;
* shafts of 1e6 N m/rad, steel of 60 mm diameter and 100 mm length;
* bearings of 1e9 N/m for all gears, some three times as stiff as a mesh.
"""

import math
from typing import Annotated

from gearlib import checks
from gearlib.models.trains import parts
from gearlib.parameters import BACKLASH, TEETH, TRUTH, Integer, Many, PressureAngle, checked


@checked
def split_power_reducer(
    pair,
    *,
    branches: Annotated[int, Integer(1, limit=100), "Double satellites, equally spaced"] = 3,
    teeth: Annotated[
        tuple | None,
        Many(TEETH, 4),
        "Of input, both gears of a satellite, output; by default (24, 36, 24, 36), with a ring "
        "gear (24, 36, 24, 84)",
    ] = None,
    internal: Annotated[bool, TRUTH, "Whether the output is a ring gear"] = False,
    modules: parts.Modules = (0.004, 0.004),
    pressure_angle: PressureAngle = parts.PRESSURE_ANGLE,
    reduced_inertias: parts.FourReduced = None,
    masses: parts.FourMasses = None,
    shaft_stiffness: parts.ShaftStiffness = 1e6,
    support_stiffness: parts.AxisStiffness = 1e9,
    structural_damping: parts.StructuralDamping = parts.STRUCTURAL_DAMPING,
    pin_errors: parts.PinErrors = None,
    backlashes: Annotated[
        tuple | None,
        Many(Many(BACKLASH, 2)),
        "Of the first and second mesh of each branch; by default that of the pair",
    ] = None,
    **options,
):
    """Return the reducer with double satellites whose axes stand still in the housing.

    Bodies are called ``input``, ``output``, ``satellite 1 a``, ``satellite 1 b``, ...; the meshes
    of branch i ``first i`` (input and a) and ``second i`` (b and output). Every mesh is `pair`, a
    `GearPair`, whose load acts on each of the first stage; other options are those of `GearTrain`.

    Raises
    ------
    ValueError
        If a value is impossible or the two stages have different centre distances.
    """
    n, pair = branches, parts.pair_of(pair)
    z = teeth or ((24, 36, 24, 84) if internal else (24, 36, 24, 36))
    sizes = [modules[i // 2] for i in range(4)]
    centres = sizes[0] * (z[0] + z[1]), sizes[2] * (z[3] - z[2] if internal else z[3] + z[2])
    if abs(centres[0] - centres[1]) > 1e-9 * centres[0]:
        raise ValueError(
            f"teeth = {z!r} is not allowed: both stages must have one centre distance, and it is "
            f"{centres[0] / 2.0:.6g} m in the first, {centres[1] / 2.0:.6g} m in the second"
        )
    errors = checks.many("pin_errors", pin_errors or [(0.0, 0.0)] * n, n)
    gaps = checks.many("backlashes", backlashes or [(pair.backlash,) * 2] * n, n)
    reduced = reduced_inertias or parts.gear_masses(pair, *z)
    bearing = support_stiffness, structural_damping
    gears = parts.Gears(pair, z, sizes, pressure_angle, reduced, masses, bearing)
    # The satellites turn clockwise. They push an external output counterclockwise, against its
    # load, and a ring gear clockwise.
    out = n * pair.load * gears.radii[1] / gears.radii[2] * (1.0 if internal else -1.0)
    bodies = [gears.body(0, "input", n * pair.load), gears.body(3, "output", out)]
    first, second, shafts = [], [], []
    for i in range(n):
        psi = 2.0 * math.pi * i / n
        a, b = f"satellite {i + 1} a", f"satellite {i + 1} b"
        (radial, tangential), (gap, second_gap) = errors[i], gaps[i]
        c, s = math.cos(psi), math.sin(psi)
        offset = c * radial - s * tangential, s * radial + c * tangential
        bodies += [gears.body(1, a, offset=offset), gears.body(2, b, offset=offset)]
        first.append(gears.mesh("input", a, name=f"first {i + 1}", position=psi, backlash=gap))
        outer = gears.mesh(
            b,
            "output",
            name=f"second {i + 1}",
            internal=internal,
            position=psi if internal else psi + math.pi,
            direction=1 if internal else -1,
            backlash=second_gap,
        )
        second.append(outer)
        shafts.append(parts.shaft_of((a, b), shaft_stiffness, structural_damping))
    return parts.train_of(bodies=bodies, meshes=first + second, shafts=shafts, **options)
