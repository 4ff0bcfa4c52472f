"""Default values that depend on the gears: dimensional quantities and names of dampings.

All other defaults are defined in the fields of the sections.
"""

import math
import re
from collections.abc import Iterable
from decimal import Decimal
from typing import Annotated, Any, get_args

from pydantic import Field, TypeAdapter, ValidationError

from gearlib import colours
from gearlib.config import overlay
from gearlib.config.experiments import COLOUR_PATTERN, Problem, Resonance
from gearlib.config.gear_pair_section import Damping, GearPairSection
from gearlib.config.gears_section import Gears
from gearlib.config.types import Name, tuning_per_rpm

#: Replacements for an invalid gear pair or invalid dampings, to avoid subsequent errors.
_VALID_PAIR = GearPairSection(**dict.fromkeys(GearPairSection.model_fields, 1.0) | {"teeth": 1})
_VALID_DAMPINGS = {"k1": Damping(material_damping=1.0, backlash_damping=0.0)}
_DAMPINGS_TYPE = TypeAdapter(Annotated[dict[Name, Damping], Field(min_length=1)])
#: Damping ratio for studies that require damping if the configuration has none.
_DAMPING_RATIO = 0.05
#: Largest number of panels of a figure (see `Basins` and `Poincare`); largest length of a title.
_MAX_PANELS, _MAX_TITLE_LENGTH = 12, 60
#: Tunings of the panels; number of mesh periods before a Poincare section.
_BASINS_TUNING, _POINCARE_TUNING, _SETTLING_PERIODS = 0.72, 0.66, 300
#: Keys of the gear bodies. If one of them is given, the others have no defaults.
_BODY_KEYS = ("base_radii", "inertias", "masses")


def add_defaults(mapping: object) -> tuple[object, dict]:
    """Return the content of a YAML file with defaults added, and the validation context.

    `mapping` is the content; if it is not a dict, it is returned unchanged with an empty context.
    The context is a dict that pydantic passes to the validators of all sections: `pair` and
    `dampings` are the validated sections or None if invalid; `by_geometry` is true if the gears are
    given by geometry, in the section `gears`.
    """
    if not isinstance(mapping, dict):
        return mapping, {}
    pair, gears, dampings = _read_gears(mapping)
    context = {"pair": pair, "dampings": dampings, "by_geometry": gears is not None}
    defaults = _gear_defaults(pair or _VALID_PAIR, dampings or _VALID_DAMPINGS)
    six_degrees = mapping.get("six_degrees") or {}
    if gears:
        defaults["resonance"] = _resonance_range(mapping.get("resonance"), pair, gears.speed)
        defaults["six_degrees"] = gears.six_degree_values()
        # The test problem "six_degrees" requires bearings, which `gears` does not define.
        if "bearing_stiffness" not in six_degrees:
            other_problems = [name for name in get_args(Problem) if name != "six_degrees"]
            defaults["work_precision"]["problems"] = other_problems
    elif isinstance(six_degrees, dict) and any(key in six_degrees for key in _BODY_KEYS):
        # Default values of the other bodies and bearings would not suit those given by the user.
        for key in (*_BODY_KEYS, "bearing_stiffness"):
            del defaults["six_degrees"][key]
    completed = overlay(defaults, mapping)
    if "gears" in mapping or pair:
        completed["gear_pair"] = pair or _VALID_PAIR
    figures = completed["figures"]
    if isinstance(figures, dict) and isinstance(figures["colours"], dict):
        figures["colours"] = _damping_colours(dampings or _VALID_DAMPINGS, figures["colours"])
    return completed, context


def _read_gears(mapping: dict) -> tuple[Any, Gears | None, dict[str, Damping] | None]:
    """Return the sections (gear pair, gears, dampings) of a configuration, None if invalid.

    `mapping` is the content of a YAML file. If it has the section `gears`, the gear pair is derived
    from this section; otherwise the returned `gears` is None. Errors are ignored here, because the
    validation of the whole configuration reports them.
    """
    pair, gears = None, None
    try:
        if "gears" in mapping:
            gears = Gears.model_validate(mapping["gears"])
            pair = GearPairSection(**gears.pair_values())
        else:
            pair = GearPairSection.model_validate(mapping.get("gear_pair"))
        context = {"pair": pair, "by_geometry": gears is not None}
        return pair, gears, _DAMPINGS_TYPE.validate_python(mapping.get("dampings"), context=context)
    except ValidationError:
        return pair, gears, None


def _resonance_range(resonance: Any, pair: Any, speed: float | None) -> dict[str, float]:
    """Return the default range of tunings of the resonance sweep for gears given by geometry.

    The tuning is the mesh frequency divided by the natural frequency. The range is from 0.5 to 1.4.
    If the operating `speed` (rpm) is given and lies outside, the range is extended to it by whole
    steps. The dict has the keys `start`, `stop` and `lowest`: below `start` the downward sweep
    continues until the motion jumps, at most down to `lowest`. The dict is empty if `resonance`,
    the section in the file, already has a start or stop, or an invalid step.
    """
    section = resonance if isinstance(resonance, dict) else {}
    step = section.get("step", Resonance.model_fields["step"].default)
    if {"start", "stop"} & section.keys() or not isinstance(step, (int, float)) or not step > 0.0:
        return {}
    start, stop = Decimal("0.5"), Decimal("1.4")
    # A tuning above 100 is not allowed; such a speed must be a mistake and is ignored.
    if speed is not None and speed * tuning_per_rpm(pair) <= 100.0:
        tuning, step = Decimal(speed * tuning_per_rpm(pair)), Decimal(repr(step))
        steps_below, steps_above = (start - tuning) / step, (tuning - stop) / step
        # The second argument of `min` keeps the first tuning above 0.
        start -= step * max(0, min(math.ceil(steps_below), math.ceil(start / step) - 1))
        stop += step * max(0, math.ceil(steps_above))
    return {"start": float(start), "stop": float(stop), "lowest": float(start) / 5.0}


def _gear_defaults(pair: GearPairSection, dampings: dict[str, Damping]) -> dict[str, dict]:
    """Return the defaults that depend on the gears, as a dict: section -> key -> default value.

    Lengths are scaled by the static deflection or the backlash of the pair. Damping values are
    taken from `dampings`, the damping combinations of the configuration by name.
    """
    damping_sums = {}  # zero for combinations without any damping
    for name, damping in dampings.items():
        damping_sums[name] = damping.material_damping + damping.backlash_damping
    damped_names = [name for name, damping_sum in damping_sums.items() if damping_sum > 0.0]
    first_damped = {"damping": next(iter(damped_names or damping_sums))}
    frequency, deflection = pair.mean_eigenfrequency, pair.static_deflection
    moderate_damping = 2.0 * _DAMPING_RATIO * pair.reduced_mass * frequency
    coefficients = [(x.material_damping, x.backlash_damping) for x in dampings.values()]
    max_damping = max(map(max, coefficients)) or moderate_damping
    # Basins of attraction require damping in contact; otherwise motions do not become periodic.
    settling = {name: x for name, x in dampings.items() if x.material_damping > 0.0}
    if not settling:
        damping = Damping(material_damping=moderate_damping, backlash_damping=moderate_damping)
        settling = {f"damping ratio {_DAMPING_RATIO:g}": damping}
    # With this coefficient, cubic and linear damping forces are equal at the velocity
    # deflection * frequency.
    cubic_damping = max_damping / (deflection * frequency) ** 2
    poincare_cases = _panel_cases(dampings, _POINCARE_TUNING)
    for name, case in zip(dampings, poincare_cases, strict=False):
        # The Poincare section is at mesh phase 0. `settle` is the number of mesh periods skipped
        # to let transients decay; without damping they do not decay.
        case |= {"phase": 0.0, "settle": _SETTLING_PERIODS if damping_sums[name] else 0}
    return {
        "phase_lag": {"material_dampings": [max_damping, max_damping / 100.0]},
        "nonlinear_damping": {"damping": max_damping},
        "six_degrees": _six_degree_defaults(pair),
        **{key: first_damped for key in ("jump", "analytic_method", "run_ups", "tolerances")},
        "train_sweep": first_damped,
        "branches": {"loci": first_damped},
        "stability_chart": {"damping": min(damping_sums, key=damping_sums.__getitem__)},
        "work_precision": {
            "damping": max_damping,
            "cubic_damping": cubic_damping if math.isfinite(cubic_damping) else max_damping,
        },
        "reducer": {
            **first_damped,
            "support_stiffness": 2.5 * pair.max_stiffness,
            "pin_error": [deflection, 0.0],  # radial and tangential
            # The first of the three branches has less backlash, so the load sharing is unequal.
            "backlashes": [0.25 * pair.backlash, pair.backlash, pair.backlash],
        },
        "basins": {"cases": _panel_cases(settling, _BASINS_TUNING)},
        "bifurcation": {"damping": next(iter(settling.values()))},
        "poincare": {"cases": poincare_cases},
        "figures": {"colours": {}},
    }


def _six_degree_defaults(pair: GearPairSection) -> dict[str, list[float]]:
    """Return bodies and bearings of two equal gears with the reduced mass of `pair`, in SI units.

    The reduced mass is defined by 1 / m_red = Rb3^2 / J3 + Rb2^2 / J2 + 1 / m3 + 1 / m2, with base
    radii Rb, moments of inertia J and masses m of the pinion (index 3 in the paper) and the wheel
    (index 2). With J = 3 Rb^2 m_red and m = 6 m_red, the four terms are 1/3, 1/3, 1/6 and 1/6 of
    1 / m_red. The four bearings (pinion y and z, wheel y and z) have 1/40 of the mesh stiffness and
    2 % of critical damping. The run-out is 0.8 static deflections, at most a fifth of the backlash.
    """
    mass = 6.0 * pair.reduced_mass
    bearing_stiffness = pair.max_stiffness / 40.0
    return {
        "base_radii": [0.1, 0.1],
        "inertias": [3.0 * 0.1**2 * pair.reduced_mass] * 2,
        "masses": [mass] * 2,
        "bearing_stiffness": [bearing_stiffness] * 4,
        "bearing_damping": [2.0 * 0.02 * math.sqrt(bearing_stiffness * mass)] * 4,
        "eccentricities": [min(0.8 * pair.static_deflection, 0.2 * pair.backlash)] * 2,
    }


def _panel_cases(dampings: dict[str, Damping], tuning: float) -> list[dict]:
    """Return the panels of a figure, one for each damping combination, all at the same tuning.

    Each panel is a dict with the keys title, tuning (mesh frequency over natural frequency) and
    damping. Only the first `_MAX_PANELS` combinations are used.
    """
    cases = []
    for name, damping in list(dampings.items())[:_MAX_PANELS]:
        title = f"tuning {tuning:.2f}, {name}"[:_MAX_TITLE_LENGTH]
        cases.append({"title": title, "tuning": tuning, "damping": damping})
    return cases


def _damping_colours(dampings: Iterable[str], configured: dict[str, str]) -> dict[str, str]:
    """Return the colours of the damping combinations as a dict: name -> "#rrggbb".

    `dampings` are the names of the combinations, and `configured` contains the colours chosen by
    the user. All others get unused colours of the palette. Invalid configured colours are kept; the
    validation reports them.
    """
    used_colours = [
        colour for colour in map(str, configured.values()) if re.fullmatch(COLOUR_PATTERN, colour)
    ]
    names = [name for name in dampings if name not in configured]
    return configured | dict(zip(names, colours.distinct_colours(used_colours), strict=False))
