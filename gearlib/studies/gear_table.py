"""Tabulate two gears: geometry, stiffness by each method, and load, in common units."""

import math
from collections.abc import Iterable, Iterator
from typing import Any, NamedTuple

import numpy as np

from gearlib.models.geometry import from_values as geometry
from gearlib.models.geometry.gear_stage import PAIR_OPTIONS
from gearlib.models.geometry.mesh_stiffness import SOURCES, UNCERTAINTY
from gearlib.models.pair import GearPair
from gearlib.models.pair_parameters import RATIOS

METHODS = ("iso", "energy")
#: Smallest amplitude of a mesh order in the table, of force or error, over the largest.
_LEAST_AMPLITUDE = 0.05
#: Note on K_v of ISO 6336-1.
_QUALITY = "; here the quality of the gears counts, and in `gearlib scatter`, not in other rows"
_DEGREE = math.pi / 180.0
#: Name, unit and meaning of a quantity, and its value from a gear and its tip clearance.
_GEAR_QUANTITIES = (
    ("teeth", "", "z", lambda gear, gap: gear.teeth),
    ("shift", "", "profile shift coefficient x", lambda gear, gap: gear.shift),
    ("reference_diameter", "mm", "d", lambda gear, gap: 1e3 * gear.reference_diameter),
    ("base_diameter", "mm", "d_b", lambda gear, gap: 1e3 * gear.base_diameter),
    ("tip_diameter", "mm", "d_a", lambda gear, gap: 1e3 * gear.tip_diameter),
    ("root_diameter", "mm", "d_f", lambda gear, gap: 1e3 * gear.root_diameter),
    ("tooth_thickness", "mm", "s_t, reference circle", lambda g, gap: 1e3 * g.tooth_thickness),
    ("tip_thickness", "mm", "s_at", lambda g, gap: 1e3 * g.thickness_at(g.tip_diameter)),
    ("clearance", "mm", "c, between its tip and the root of the other", lambda g, gap: 1e3 * gap),
    ("mass", "kg", "of the blank at the mean diameter", lambda gear, gap: gear.mass),
    ("inertia", "kg m^2", "J about the axis", lambda gear, gap: gear.inertia),
)
#: Name, unit and meaning of a quantity, and its value from a mesh m and its `GearPair` p.
_MESH_QUANTITIES = (
    ("centre_distance", "mm", "a", lambda m, p: 1e3 * m.centre_distance),
    ("working_pressure_angle", "deg", "alpha_wt", lambda m, p: m.working_pressure_angle / _DEGREE),
    ("base_pitch", "mm", "p_bt", lambda m, p: 1e3 * m.base_pitch),
    ("transverse_contact_ratio", "", "eps_alpha", lambda m, p: m.contact_ratio),
    ("overlap_ratio", "", "eps_beta", lambda m, p: m.overlap_ratio),
    ("normal_backlash", "um", "j_bn", lambda m, p: 1e6 * m.backlash),
    ("recommended_backlash", "um", "ISO/TR 10064-2", lambda m, p: 1e6 * m.recommended_backlash),
    ("backlash", "um", "s_k, along the line of action", lambda m, p: 1e6 * m.line_backlash),
    ("reduced_mass", "kg", "m_red", lambda m, p: p.reduced_mass),
    ("torque", "N m", "of the pinion", lambda m, p: p.load * m.pinion.base_diameter / 2.0),
    ("load", "N", "F, along the line of action", lambda m, p: p.load),
)
#: Name, unit and meaning, and value from the `GearPair` p by one stiffness method.
_STIFFNESS_QUANTITIES = (
    ("max_stiffness", "N/m", "C_max", lambda p: p.max_stiffness),
    ("mean_stiffness", "N/m", "C_s", lambda p: p.mean_stiffness),
    ("stiffness_ratio", "", "kappa = C_min / C_max", lambda p: p.stiffness_ratio),
    ("contact_ratio", "", "epsilon of the rectangle", lambda p: p.contact_ratio),
    ("static_deflection", "um", "F / C_s", lambda p: 1e6 * p.static_deflection),
    ("backlash_ratio", "", "s_k in static deflections", lambda p: p.backlash_ratio),
    ("eigenfrequency", "Hz", "Omega_s / 2 pi", lambda p: p.mean_eigenfrequency / math.tau),
    ("resonance_speed", "rpm", "of the pinion at tuning 1, n_E1", lambda p: p.speed(1.0)),
    ("material_damping", "N s/m", "k_1", lambda p: p.material_damping),
    ("damping_ratio", "", "beta", lambda p: p.damping_ratio),
    ("backlash_damping_ratio", "", "beta_m", lambda p: p.backlash_damping_ratio),
)
#: Those of a `GearPair` p that is given by its numbers.
_PAIR_QUANTITIES = (
    ("reduced_mass", "kg", "m_red", lambda p: p.reduced_mass),
    ("load", "N", "F, along the line of action", lambda p: p.load),
    ("backlash", "um", "s_k, along the line of action", lambda p: 1e6 * p.backlash),
)
_DAMPING_NAMES = {"material_damping", "damping_ratio", "backlash_damping_ratio"}


class Quantity(NamedTuple):
    """A row of the table: a quantity of both gears, of the mesh, or by each stiffness method."""

    name: str
    unit: str
    values: dict  #: name of the gear or of the stiffness method, or "mesh" -> value
    meaning: str


def gear_quantities(
    mesh: Any, *, damping: dict | None = None, options: dict | None = None, **load: Any
) -> list[Quantity]:
    """Return geometry, stiffness and load of a `Mesh` as rows of a table.

    `damping` has ratios, which hold for every method, or material_damping and backlash_damping
    (N s/m); `options` maps each stiffness method to its options; `load` has torque (N m), or power
    (W) and speed (rpm). A method that is not valid for these gears is omitted.
    """
    damping = damping or {"material_damping": 0.0}
    coefficients = {name: value for name, value in damping.items() if name in RATIOS.values()}
    ratios = {name: value for name, value in damping.items() if name not in coefficients}
    pairs, refusals = {}, []  # method -> `GearPair`
    for method in METHODS:
        stiffness = {"stiffness": method, "options": (options or {}).get(method)}
        try:
            pair = GearPair.from_geometry(mesh, **load, **stiffness, **ratios)
        except ValueError as error:
            # ISO 6336 has no stiffness for transverse contact ratios below 1, and the gear body of
            # the energy method is not defined for large bores.
            refusals.append(error)
            continue
        pairs[method] = pair.replace(**coefficients)
    if not pairs:
        raise refusals[0]
    # Tip clearances (m), between the tip of a gear and the root of the other one.
    pinion_clearance, wheel_clearance = mesh.clearances
    gears = {"pinion": (mesh.pinion, pinion_clearance), "wheel": (mesh.wheel, wheel_clearance)}
    rows = [
        *_quantities(_GEAR_QUANTITIES, gears),
        *_quantities(_MESH_QUANTITIES, {"mesh": (mesh, next(iter(pairs.values())))}),
        *_quantities(_STIFFNESS_QUANTITIES, {method: (pair,) for method, pair in pairs.items()}),
    ]
    uncertainties = {method: 100.0 * UNCERTAINTY[method] for method in pairs}
    sources = "; ".join(f"{method}: {SOURCES[method]}" for method in pairs)
    meaning = f"of the stiffness; {sources}{_note_on_ranges(pairs)}"
    return [*rows, Quantity("uncertainty", "%", uncertainties, meaning)]


def _note_on_ranges(pairs: dict[str, GearPair]) -> str:
    """Return a text if the uncertain mean stiffnesses of the methods do not overlap, else ""."""
    means = {method: pair.mean_stiffness for method, pair in pairs.items()}
    lowest = max(mean * (1.0 - UNCERTAINTY[method]) for method, mean in means.items())
    highest = min(mean * (1.0 + UNCERTAINTY[method]) for method, mean in means.items())
    if lowest <= highest:
        return ""
    ratio = max(means.values()) / min(means.values())
    return f". The means differ by the factor {ratio:.3g}: these ranges do not overlap"


def _quantities(definitions: Iterable[tuple], arguments: dict[str, tuple]) -> list[Quantity]:
    """Return the quantities that are defined by (name, unit, meaning, function).

    `arguments` maps the name of each column of values to the arguments of the functions.
    """
    return [
        Quantity(name, unit, {column: value(*args) for column, args in arguments.items()}, meaning)
        for name, unit, meaning, value in definitions
    ]


def cells(quantities: Iterable[Quantity]) -> Iterator[list]:
    """Yield the names of the columns, then a row for each value; "of" names its gear or method."""
    yield ["name", "of", "value", "unit", "meaning"]
    for row in quantities:
        yield from ([row.name, of, x, row.unit, row.meaning] for of, x in row.values.items())


def rows(pairs: dict[str, GearPair], gears: dict | None) -> Iterator[list]:
    """Yield the rows of the table of a configuration: of its `gears`, if any, and of its pairs.

    `pairs` maps names of dampings to the gear pair that runs.
    """
    models = {name: (pair,) for name, pair in pairs.items()}
    if gears:
        options = {gears.get("stiffness", "iso"): gears.get("stiffness_options")}
        mesh = geometry.stage(gears)
        quantities = gear_quantities(mesh, options=options, torque=gears["torque"])
    else:
        pair = next(iter(models.values()))
        quantities = _quantities((*_PAIR_QUANTITIES, *_STIFFNESS_QUANTITIES), {"pair": pair})
    quantities = [x for x in quantities if x.name not in _DAMPING_NAMES]
    dampings = [x for x in _STIFFNESS_QUANTITIES if x[0] in _DAMPING_NAMES]
    header, *body = cells([*quantities, *_quantities(dampings, models)])
    yield header
    for name, of, value, unit, meaning in body:
        yield [name, of, f"{value:.6g}", unit, meaning]


def duty_rows(model: Any, speed: float, torque: float, stiffness_model: str) -> Iterator[Quantity]:
    """Yield the quantities of a `LoadSharingPair` at a speed in rpm and a torque in N m.

    Gears, damping and stiffness are those of the model; `stiffness_model` describes it in words.
    """
    # Imported here, because a table without this point does not need the compiled kernels.
    from gearlib.analysis.duty_point import duty_point

    ratios = {name: getattr(model, name) for name in ("damping_ratio", "backlash_damping_ratio")}
    options = {name: getattr(model, name) for name in PAIR_OPTIONS}
    method = {"stiffness": model.stiffness, "options": options}
    point = duty_point(model.stage, speed, torque=torque, **method, **ratios)
    damping = "beta {damping_ratio:.4g}, beta_m {backlash_damping_ratio:.4g}".format(**ratios)
    notes = {"dynamic_factor": f"; {stiffness_model}; {damping}", "iso_dynamic_factor": _QUALITY}
    amplitudes = np.stack([point[name] for name in ("mesh_order_force", "mesh_order_error")])
    # Amplitudes are NaN if there are too few samples.
    largest = np.fmax.reduce(amplitudes, axis=1, keepdims=True)
    listed = np.flatnonzero((amplitudes > _LEAST_AMPLITUDE * largest).any(0))
    table_units = {"m": ("um", 1e6), "min-1": ("rpm", 1.0), "1": ("", 1.0)}
    for name, variable in point.drop_vars("torque").data_vars.items():
        unit, scale = table_units.get(variable.units, (variable.units, 1.0))
        if variable.ndim:
            values = {f"order {i + 1}": scale * float(variable[i]) for i in listed}
        else:
            values = {"duty point": scale * variable.item()}
        yield Quantity(name, unit, values, variable.long_name + notes.get(name, ""))
