"""The table of two drawn gears: geometry, stiffness by each method, load, in units of drawings."""

import math
from typing import NamedTuple

from gearlib.models.geometry.mesh_stiffness import SOURCES, UNCERTAINTY
from gearlib.models.pair import GearPair

#: Mesh orders of the duty point that are told.
_ORDERS = (1, 2, 3)
GEARS = ("pinion", "wheel")
METHODS = ("iso", "energy")


class Quantity(NamedTuple):
    """One row: a quantity of both gears, of the mesh, or by each method of stiffness."""

    name: str
    unit: str
    values: dict  #: of which gear or by which method -> value; "mesh" for what there is once
    meaning: str


def compute(mesh, *, damping=None, options=None, **load):
    """Return the rows of the table.

    damping: material_damping and backlash_damping, N s/m; options: method of stiffness -> its
    options; **load: torque, or power and speed, as in `GearPair.from_geometry`.

    A method that does not hold for these gears is left out of the rows.
    """
    pairs = {}
    for method in METHODS:
        try:
            more = {"stiffness": method, "options": (options or {}).get(method)}
            pair = GearPair.from_geometry(mesh, **load, **more)
        except ValueError:
            # Bores that the body of the energy method does not take.
            if method == "iso":
                raise
            continue
        pairs[method] = pair.replace(**(damping or {"material_damping": 0.0}))
    return [*_of_gears(mesh), *_of_mesh(mesh, pairs["iso"]), *_of_stiffness(pairs)]


def duty_rows(mesh, speed, *, damping=None, stiffness=None, options=None, **load):
    """Return the rows of the duty point at a speed in rpm.

    stiffness, options: those of `gearlib.duty_point`; other arguments are those of `compute`.
    """
    # Here: the table without it does not load the kernels.
    from gearlib.analysis.duty_point import duty_point

    known = {"stiffness": stiffness or "iso", "options": options, "speed": speed}
    pair = GearPair.from_geometry(mesh, **known, **load).replace(**(damping or {}))
    load |= {name: getattr(pair, name) for name in ("damping_ratio", "backlash_damping_ratio")}
    found = duty_point(mesh, speed, stiffness=stiffness, options=options, **load)
    lengths = {"m": ("um", 1e6), "min-1": ("rpm", 1.0)}
    for name, variable in found.data_vars.items():
        unit, scale = lengths.get(variable.units, (variable.units, 1.0))
        if variable.ndim:
            values = {f"order {n}": scale * variable.values[n - 1] for n in _ORDERS}
        else:
            values = {"duty point": scale * variable.item()}
        if name != "torque":
            yield Quantity(name, unit, values, variable.long_name)


def _of_gears(mesh):
    def row(name, unit, scale, value, meaning):
        values = {gear: scale * value(getattr(mesh, gear)) for gear in GEARS}
        return Quantity(name, unit, values, meaning)

    def diameter(name, symbol):
        return row(f"{name}_diameter", "mm", 1e3, lambda g: getattr(g, f"{name}_diameter"), symbol)

    yield row("teeth", "1", 1, lambda g: g.teeth, "z")
    yield row("shift", "1", 1.0, lambda g: g.shift, "profile shift coefficient x")
    for name, symbol in (("reference", "d"), ("base", "d_b"), ("tip", "d_a"), ("root", "d_f")):
        yield diameter(name, symbol)
    yield row("tooth_thickness", "mm", 1e3, lambda g: g.tooth_thickness, "s_t, reference circle")
    yield row("tip_thickness", "mm", 1e3, lambda g: g.thickness_at(g.tip_diameter), "s_at")
    gaps = {name: 1e3 * gap for name, gap in zip(GEARS, mesh.clearances, strict=True)}
    yield Quantity("clearance", "mm", gaps, "c, between its tip and the root of the other")
    yield row("mass", "kg", 1.0, lambda g: g.mass, "of the blank at the mean diameter")
    yield row("inertia", "kg m^2", 1.0, lambda g: g.inertia, "J about the axis")


def _of_mesh(mesh, pair):
    angle = math.degrees(mesh.working_pressure_angle)
    for name, unit, value, meaning in (
        ("centre_distance", "mm", 1e3 * mesh.centre_distance, "a"),
        ("working_pressure_angle", "deg", angle, "alpha_wt"),
        ("base_pitch", "mm", 1e3 * mesh.base_pitch, "p_bt"),
        ("transverse_contact_ratio", "1", mesh.contact_ratio, "eps_alpha"),
        ("overlap_ratio", "1", mesh.overlap_ratio, "eps_beta"),
        ("normal_backlash", "um", 1e6 * mesh.backlash, "j_bn"),
        ("recommended_backlash", "um", 1e6 * mesh.recommended_backlash, "least, ISO/TR 10064-2"),
        ("backlash", "um", 1e6 * mesh.line_backlash, "s_k, along the line of action"),
        ("reduced_mass", "kg", pair.reduced_mass, "m_red"),
        ("torque", "N m", pair.load * mesh.pinion.base_diameter / 2.0, "of the pinion"),
        ("load", "N", pair.load, "F, along the line of action"),
    ):
        yield Quantity(name, unit, {"mesh": value}, meaning)


def _of_stiffness(pairs):
    for name, unit, value, meaning in (
        ("max_stiffness", "N/m", lambda p: p.max_stiffness, "C_max"),
        ("mean_stiffness", "N/m", lambda p: p.mean_stiffness, "C_s"),
        ("stiffness_ratio", "1", lambda p: p.stiffness_ratio, "kappa = C_min / C_max"),
        ("contact_ratio", "1", lambda p: p.contact_ratio, "epsilon of the rectangle"),
        ("static_deflection", "um", lambda p: 1e6 * p.static_deflection, "F / C_s"),
        ("backlash_ratio", "1", lambda p: p.backlash_ratio, "s_k in static deflections"),
        ("eigenfrequency", "Hz", lambda p: p.mean_eigenfrequency / math.tau, "Omega_s / 2 pi"),
        ("resonance_speed", "rpm", lambda p: p.speed(1.0), "of the pinion at tuning 1, n_E1"),
        ("material_damping", "N s/m", lambda p: p.material_damping, "k_1"),
        ("damping_ratio", "1", lambda p: p.damping_ratio, "beta"),
        ("backlash_damping_ratio", "1", lambda p: p.backlash_damping_ratio, "beta_m"),
    ):
        yield Quantity(name, unit, {method: value(pair) for method, pair in pairs.items()}, meaning)
    spread = {method: 100.0 * UNCERTAINTY[method] for method in pairs}
    sources = "; ".join(f"{method}: {SOURCES[method]}" for method in pairs)
    yield Quantity("uncertainty", "%", spread, f"of the stiffness; {sources}")
