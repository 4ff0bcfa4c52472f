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
#: Smallest amplitude of a mesh order in the table, relative to the largest amplitude.
_MIN_RELATIVE_AMPLITUDE = 0.05
#: Note on the dynamic factor K_v of ISO 6336-1.
_QUALITY = "; here the quality of the gears counts, and in `gearlib scatter`, not in other rows"
_DEGREE = math.pi / 180.0
#: Name, unit and meaning of each quantity, and a function of a gear and its tip clearance, m.
_GEAR_QUANTITIES = (
    ("teeth", "", "z", lambda gear, gap: gear.teeth),
    ("shift", "", "profile shift coefficient x", lambda gear, gap: gear.shift),
    ("reference_diameter", "mm", "d", lambda gear, gap: 1e3 * gear.reference_diameter),
    ("base_diameter", "mm", "d_b", lambda gear, gap: 1e3 * gear.base_diameter),
    ("tip_diameter", "mm", "d_a", lambda gear, gap: 1e3 * gear.tip_diameter),
    ("root_diameter", "mm", "d_f", lambda gear, gap: 1e3 * gear.root_diameter),
    ("tooth_thickness", "mm", "s_t, reference circle", lambda g, gap: 1e3 * g.tooth_thickness),
    ("tip_thickness", "mm", "s_at", lambda g, gap: 1e3 * g.thickness_at(g.tip_diameter)),
    ("clearance", "mm", "c, from its tip to the mating root", lambda gear, gap: 1e3 * gap),
    ("mass", "kg", "of the blank at the mean diameter", lambda gear, gap: gear.mass),
    ("inertia", "kg m^2", "J about the axis", lambda gear, gap: gear.inertia),
)
#: Name, unit and meaning of each quantity, and a function of a `GearStage` m and its `GearPair` p.
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
#: Name, unit and meaning of each quantity, and a function of the `GearPair` p by one method.
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
#: The same for a `GearPair` p that is not given by its geometry.
_PAIR_QUANTITIES = (
    ("reduced_mass", "kg", "m_red", lambda p: p.reduced_mass),
    ("load", "N", "F, along the line of action", lambda p: p.load),
    ("backlash", "um", "s_k, along the line of action", lambda p: 1e6 * p.backlash),
)
_DAMPING_NAMES = {"material_damping", "damping_ratio", "backlash_damping_ratio"}


class Quantity(NamedTuple):
    """A row of the table: a quantity of both gears, of the mesh, or for each stiffness method."""

    name: str
    unit: str
    values: dict  #: "pinion" and "wheel", "mesh" or the stiffness methods -> value
    meaning: str


def gear_quantities(
    mesh: Any, *, damping: dict | None = None, options: dict | None = None, **load: Any
) -> list[Quantity]:
    """Return geometry, stiffness and load of two gears in mesh as rows of a table.

    `mesh` is a `GearStage`. `damping` has either damping ratios, used for every stiffness method,
    or the coefficients material_damping and backlash_damping (N s/m); None means undamped.
    `options` maps the stiffness methods "iso" and "energy" to their options. `load` has torque
    (N m), or power (W) and speed (rpm). Methods that are not valid for these gears are skipped;
    raise ValueError if none is valid.
    """
    damping = damping or {"material_damping": 0.0}
    coefficients = {name: value for name, value in damping.items() if name in RATIOS.values()}
    ratios = {name: value for name, value in damping.items() if name not in coefficients}
    pairs = {}  # method -> `GearPair`
    errors = []  # of methods that are not valid for these gears
    for method in METHODS:
        stiffness = {"stiffness": method, "options": (options or {}).get(method)}
        try:
            pair = GearPair.from_geometry(mesh, **load, **stiffness, **ratios)
        except ValueError as error:
            # ISO 6336 requires a transverse contact ratio of at least 1, and the gear body model of
            # the energy method requires a small bore.
            errors.append(error)
            continue
        pairs[method] = pair.replace(**coefficients)
    if not pairs:
        raise errors[0]
    pinion_clearance, wheel_clearance = mesh.clearances
    gears = {"pinion": (mesh.pinion, pinion_clearance), "wheel": (mesh.wheel, wheel_clearance)}
    rows = [
        *_evaluate_quantities(_GEAR_QUANTITIES, gears),
        *_evaluate_quantities(_MESH_QUANTITIES, {"mesh": (mesh, next(iter(pairs.values())))}),
        *_evaluate_quantities(
            _STIFFNESS_QUANTITIES, {method: (pair,) for method, pair in pairs.items()}
        ),
    ]
    uncertainties = {method: 100.0 * UNCERTAINTY[method] for method in pairs}
    sources = "; ".join(f"{method}: {SOURCES[method]}" for method in pairs)
    meaning = f"of the stiffness; {sources}{_describe_contradiction(pairs)}"
    return [*rows, Quantity("uncertainty", "%", uncertainties, meaning)]


def _describe_contradiction(pairs: dict[str, GearPair]) -> str:
    """Return a note for the table if the stiffness methods contradict each other, else "".

    Methods contradict each other if their ranges of mean stiffness, mean +- `UNCERTAINTY`, do not
    overlap. `pairs` maps the name of a method to the `GearPair` with this stiffness.
    """
    means = {method: pair.mean_stiffness for method, pair in pairs.items()}
    max_lower_bound = max(mean * (1.0 - UNCERTAINTY[method]) for method, mean in means.items())
    min_upper_bound = min(mean * (1.0 + UNCERTAINTY[method]) for method, mean in means.items())
    if max_lower_bound <= min_upper_bound:
        return ""
    ratio = max(means.values()) / min(means.values())
    return f". The means differ by a factor of {ratio:.3g}: these ranges do not overlap"


def _evaluate_quantities(
    definitions: Iterable[tuple], arguments: dict[str, tuple]
) -> list[Quantity]:
    """Evaluate `definitions` of quantities, tuples (name, unit, meaning, function).

    `arguments` maps the label of a column, such as "pinion" or the name of a stiffness method, to
    the arguments of the functions.
    """
    quantities = []
    for name, unit, meaning, function in definitions:
        values = {label: function(*args) for label, args in arguments.items()}
        quantities.append(Quantity(name, unit, values, meaning))
    return quantities


def quantity_rows(quantities: Iterable[Quantity]) -> Iterator[list]:
    """Yield table rows, beginning with the column names; each value of a quantity has one row.

    The column "of" states the gear, the mesh or the stiffness method to which a value belongs.
    """
    yield ["name", "of", "value", "unit", "meaning"]
    for quantity in quantities:
        for label, value in quantity.values.items():
            yield [quantity.name, label, value, quantity.unit, quantity.meaning]


def table_rows(pairs: dict[str, GearPair], gears: dict | None) -> Iterator[list]:
    """Yield the rows of the gear table of a configuration, beginning with the column names.

    The rows are quantities of the gears or of the pair, followed by those of the damping
    combinations. `pairs` maps names of damping combinations to pairs. `gears` has the data of two
    gears, their torque (N m) and stiffness method, or is None if their geometry is not given.
    """
    models = {name: (pair,) for name, pair in pairs.items()}
    if gears:
        options = {gears.get("stiffness", "iso"): gears.get("stiffness_options")}
        mesh = geometry.build_stage(gears)
        quantities = gear_quantities(mesh, options=options, torque=gears["torque"])
    else:
        any_pair = next(iter(models.values()))
        definitions = (*_PAIR_QUANTITIES, *_STIFFNESS_QUANTITIES)
        quantities = _evaluate_quantities(definitions, {"pair": any_pair})
    quantities = [quantity for quantity in quantities if quantity.name not in _DAMPING_NAMES]
    damping_definitions = [
        definition for definition in _STIFFNESS_QUANTITIES if definition[0] in _DAMPING_NAMES
    ]
    header, *body = quantity_rows([*quantities, *_evaluate_quantities(damping_definitions, models)])
    yield header
    for name, label, value, unit, meaning in body:
        yield [name, label, f"{value:.6g}", unit, meaning]


def duty_point_rows(
    model: Any, speed: float, torque: float, stiffness_model: str
) -> Iterator[Quantity]:
    """Yield the dynamic quantities of two gears at a duty point, i.e. a speed and a torque.

    `model` is a `LoadSharingPair`, `speed` is in rpm and `torque` in N m. `stiffness_model` is a
    description of the stiffness for the table. Small amplitudes of mesh orders (multiples of the
    mesh frequency) are omitted.
    """
    # A table without a duty point does not need the compiled kernels of this module.
    from gearlib.analysis.duty_point import duty_point

    ratios = {name: getattr(model, name) for name in ("damping_ratio", "backlash_damping_ratio")}
    options = {name: getattr(model, name) for name in PAIR_OPTIONS}
    method = {"stiffness": model.stiffness, "options": options}
    point = duty_point(model.stage, speed, torque=torque, **method, **ratios)
    damping = "beta {damping_ratio:.4g}, beta_m {backlash_damping_ratio:.4g}".format(**ratios)
    notes = {"dynamic_factor": f"; {stiffness_model}; {damping}", "iso_dynamic_factor": _QUALITY}
    amplitudes = np.stack([point[name] for name in ("mesh_order_force", "mesh_order_error")])
    # Amplitudes are NaN if there are too few samples; `fmax` ignores NaN.
    largest = np.fmax.reduce(amplitudes, axis=1, keepdims=True)
    is_large = amplitudes > _MIN_RELATIVE_AMPLITUDE * largest
    order_indices = np.flatnonzero(is_large.any(0))
    # Unit in the dataset -> (unit in the table, conversion factor).
    table_units = {"m": ("um", 1e6), "min-1": ("rpm", 1.0), "1": ("", 1.0)}
    for name, variable in point.drop_vars("torque").data_vars.items():
        unit, scale = table_units.get(variable.units, (variable.units, 1.0))
        if variable.ndim:
            values = {f"order {i + 1}": scale * float(variable[i]) for i in order_indices}
        else:
            values = {"duty point": scale * variable.item()}
        yield Quantity(name, unit, values, variable.long_name + notes.get(name, ""))
