"""`characteristic_frequencies`: mesh, shaft, hunting tooth and planet frequencies at a speed."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from gearlib import checks
from gearlib.data.result import make_study_result
from gearlib.models.geometry.gear_stage import GearStage
from gearlib.parameters import Speed, checked

#: Variables of the dataset in Hz.
FREQUENCIES = (
    *("mesh_frequency_hertz", "hunting_tooth_frequency", "assembly_phase_frequency"),
    *("sideband_spacing", "shaft_frequency", "planet_passing_frequency"),
)


@checked
def characteristic_frequencies(gears, speed: Speed):
    """Compute the frequencies at which gears excite or modulate vibration at a given speed.

    Parameters
    ----------
    gears : gearlib.geometry.GearStage or GearTrain
        Two gears given by geometry, or a train.
    speed : float
        Speed in rpm of the pinion or, for a train, of the reference pinion relative to the housing.

    Returns
    -------
    xarray.Dataset
        All frequencies are in Hz. Over ``mesh``: mesh_frequency_hertz f; hunting_tooth_frequency,
        f divided by the least common multiple of the tooth numbers, at which the same two teeth
        meet; assembly_phase_frequency, f divided by their greatest common divisor. Over ``mesh``
        and ``gear``: sideband_spacing, f divided by the tooth number, at which a given tooth of the
        pinion or of the wheel returns to the mesh. Over ``body``: shaft_frequency relative to the
        housing, and planet_passing_frequency, at which planets pass a given tooth of a central
        gear (NaN for other bodies).

    Raises
    ------
    ValueError
        If an argument is invalid.
    """
    if isinstance(gears, GearStage):
        body_names, mesh_names = ["pinion", "wheel"], ["pinion-wheel"]
        tooth_numbers = [(gears.pinion.teeth, gears.wheel.teeth)]
        mesh_frequencies = np.array([speed / 60.0 * gears.pinion.teeth])
        shaft_frequencies = mesh_frequencies / tooth_numbers[0]
        passing_frequencies = np.full(2, math.nan)
    else:
        train: Any = getattr(gears, "train", None)
        allowed = "a gearlib.geometry.GearStage or a gearlib.GearTrain"
        checks.require(train is not None, "gears", gears, allowed)
        body_names, mesh_names = list(train.body_names), list(train.mesh_names)
        tooth_numbers = [
            (train.by_name[mesh.pinion].teeth, train.by_name[mesh.wheel].teeth)
            for mesh in train.meshes
        ]
        # The speeds of a train are stated relative to the frequency of its reference mesh.
        body_speeds = train.speeds.in_housing
        reference_frequency = speed / 60.0 / abs(float(body_speeds[train.reference_pinion.name]))
        frequency_ratios = [float(ratio) for ratio in train.frequency_ratios]
        mesh_frequencies = reference_frequency * np.array(frequency_ratios)
        speed_ratios = [abs(float(body_speeds[name])) for name in body_names]
        shaft_frequencies = reference_frequency * np.array(speed_ratios)
        passing_frequencies = _planet_passing_frequencies(train, reference_frequency)
    common_multiples = [math.lcm(*teeth) for teeth in tooth_numbers]
    common_divisors = [math.gcd(*teeth) for teeth in tooth_numbers]
    data: dict[str, Any] = {
        "mesh_frequency_hertz": ("mesh", mesh_frequencies),
        "hunting_tooth_frequency": ("mesh", mesh_frequencies / common_multiples),
        "assembly_phase_frequency": ("mesh", mesh_frequencies / common_divisors),
        "sideband_spacing": (("mesh", "gear"), mesh_frequencies[:, None] / np.array(tooth_numbers)),
        "shaft_frequency": ("body", shaft_frequencies),
        "planet_passing_frequency": ("body", passing_frequencies),
        "speed": speed,
    }
    coords = {"mesh": mesh_names, "gear": ["pinion", "wheel"], "body": body_names}
    return make_study_result("Characteristic frequencies of gears", data, coords)


def _planet_passing_frequencies(train: Any, reference_frequency: float) -> np.ndarray:
    """Return the planet passing frequency of each body of a `GearTrain` in Hz.

    It is the number of planets that mesh with the body, times the rotational frequency of the body
    relative to the axes of the planets, and NaN for a body that meshes with no planet.
    `reference_frequency` is the frequency of the reference mesh in Hz.
    """
    planets_of_gear: dict[str, set] = {}  # names of the planets that mesh with each gear
    for mesh in train.meshes:
        for planet, gear in ((mesh.pinion, mesh.wheel), (mesh.wheel, mesh.pinion)):
            # Only planets have a carrier; either gear of a mesh may be the planet.
            if train.by_name[planet].carrier:
                planets_of_gear.setdefault(gear, set()).add(planet)
    frequencies = np.full(len(train.body_names), math.nan)
    for i, name in enumerate(train.body_names):
        planet_count = len(planets_of_gear.get(name, ()))
        speed_ratio = abs(float(train.speeds.in_frame[name]))
        if planet_count and speed_ratio:
            frequencies[i] = reference_frequency * (planet_count * speed_ratio)
    return frequencies


def frequency_rows(frequencies: xr.Dataset) -> Iterator[list]:
    """Yield the rows of a table of characteristic frequencies, starting with the column headings.

    `frequencies` is a result of `characteristic_frequencies`. Each row contains the name of the
    mesh or body, the kind of frequency (e.g. "shaft frequency"), its value in Hz, and its order,
    the ratio of the frequency to the given shaft speed in rev/s. NaN values are skipped.
    """
    yield ["of", "frequency", "hertz", "order"]
    shaft_frequency = float(frequencies.speed) / 60.0
    for variable_name in FREQUENCIES:
        variable = frequencies[variable_name]
        kind = variable_name.removesuffix("_hertz").replace("_", " ")
        # All dimensions of the variable are stacked into one, to iterate over scalar values.
        for cell in variable.stack(cell=variable.dims, create_index=False).transpose("cell"):
            frequency = float(cell)
            if np.isfinite(frequency):
                owner = " ".join(str(cell[dim].item()) for dim in variable.dims)
                order = frequency / shaft_frequency
                yield [owner, kind, f"{frequency:.6g}", f"{order:.6g}"]
