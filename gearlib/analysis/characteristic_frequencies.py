"""`characteristic_frequencies`: mesh, shaft, hunting tooth and planet frequencies at a speed."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data.result import result_of_many
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.parameters import Speed, checked

#: Variables of the dataset in Hz.
FREQUENCIES = (
    *("mesh_frequency_hertz", "hunting_tooth_frequency", "assembly_phase_frequency"),
    *("sideband_spacing", "shaft_frequency", "planet_passing_frequency"),
)


@checked
def characteristic_frequencies(gears, speed: Speed):
    """Return the frequencies at which gears excite or modulate vibration at a speed.

    Parameters
    ----------
    gears : gearlib.geometry.GearStage or GearTrain
        Two gears given by geometry, or a train.
    speed : float
        Speed of the pinion, of a train of the reference pinion in the housing, rpm.

    Returns
    -------
    xarray.Dataset
        Over ``mesh``: mesh_frequency_hertz f; hunting_tooth_frequency, f over the least common
        multiple of the numbers of teeth, at which the same two teeth meet;
        assembly_phase_frequency, f over their greatest common divisor. Over ``mesh`` and ``gear``:
        sideband_spacing, at which the teeth of pinion and wheel pass the line of centres in turn.
        Over ``body``: shaft_frequency in the housing, and planet_passing_frequency, at which
        planets pass a tooth of a central gear, NaN for other bodies. All in Hz.

    Raises
    ------
    ValueError
        If an argument is wrong.
    """
    if isinstance(gears, GearStage):
        counts, names = [(gears.pinion.teeth, gears.wheel.teeth)], ["pinion", "wheel"]
        frequencies = np.array([speed / 60.0 * gears.pinion.teeth])
        shafts, meshes = frequencies / counts[0], ["pinion-wheel"]
        passing = np.full(2, math.nan)
    else:
        train: Any = getattr(gears, "train", None)
        allowed = "a gearlib.geometry.GearStage or a gearlib.GearTrain"
        checks.require(train is not None, "gears", gears, allowed)
        names, meshes = list(train.body_names), list(train.mesh_names)
        counts = [tuple(train.by_name[x].teeth for x in (m.pinion, m.wheel)) for m in train.meshes]
        in_housing = train.speeds.in_housing
        reference = speed / 60.0 / abs(float(in_housing[train.reference_pinion.name]))
        frequencies = reference * np.array(list(map(float, train.frequency_ratios)))
        shafts = reference * np.array([abs(float(in_housing[name])) for name in names])
        passing = _planet_passing(train, reference)
    data: dict[str, Any] = {
        "mesh_frequency_hertz": ("mesh", frequencies),
        "hunting_tooth_frequency": ("mesh", frequencies / [math.lcm(*z) for z in counts]),
        "assembly_phase_frequency": ("mesh", frequencies / [math.gcd(*z) for z in counts]),
        "sideband_spacing": (("mesh", "gear"), frequencies[:, None] / np.array(counts)),
        "shaft_frequency": ("body", shafts),
        "planet_passing_frequency": ("body", passing),
        "speed": speed,
    }
    coords = {"mesh": meshes, "gear": ["pinion", "wheel"], "body": names}
    return result_of_many("Characteristic frequencies of gears", data, coords)


def _planet_passing(train: Any, reference: float) -> np.ndarray:
    """Return the planet passing frequencies of the bodies of a train in Hz, NaN without planets.

    `reference` is the frequency of the reference mesh in Hz.
    """
    planets: dict[str, set] = {}  # central gear -> planets that mesh with it
    for mesh in train.meshes:
        for planet, central in ((mesh.pinion, mesh.wheel), (mesh.wheel, mesh.pinion)):
            if train.by_name[planet].carrier:
                planets.setdefault(central, set()).add(planet)
    speeds = train.speeds.in_frame
    rates = [len(planets.get(name, ())) * abs(float(speeds[name])) for name in train.body_names]
    return np.array([reference * rate if rate else math.nan for rate in rates])


def frequency_rows(frequencies: xr.Dataset) -> Iterator[list]:
    """Yield the rows of a table of characteristic frequencies, the names of the columns first.

    Orders are multiples of the speed.
    """
    yield ["of", "frequency", "hertz", "order"]
    shaft = float(frequencies.speed) / 60.0
    for name in FREQUENCIES:
        variable = frequencies[name]
        for cell in variable.stack(cell=variable.dims, create_index=False).transpose("cell"):
            if np.isfinite(value := float(cell)):
                owner = " ".join(str(cell[dim].item()) for dim in variable.dims)
                kind = name.removesuffix("_hertz").replace("_", " ")
                yield [owner, kind, f"{value:.6g}", f"{value / shaft:.6g}"]
