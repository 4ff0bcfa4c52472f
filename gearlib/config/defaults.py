"""Defaults that depend on the gears: what a configuration leaves out is made from those it names.

All others stand beside their fields. Here is what has a dimension or names a damping: numbers that
suit one gear pair are wrong for the next.
"""

import itertools
import math
from decimal import Decimal
from typing import Annotated, get_args

from pydantic import Field, TypeAdapter, ValidationError

from gearlib.config import laid_over
from gearlib.config.experiments import Problem, Resonance
from gearlib.config.gear_pair_section import Damping, GearPairSection
from gearlib.config.gears_section import Gears
from gearlib.config.types import Name, tuning_per_rpm

#: Stand-ins while those of a configuration are refused, so that only those are complained about.
_PAIR = GearPairSection(**dict.fromkeys(GearPairSection.model_fields, 1.0) | {"teeth": 1})
_DAMPINGS = {"k1": Damping(material_damping=1.0, backlash_damping=0.0)}
_DAMPINGS_TYPE = TypeAdapter(Annotated[dict[Name, Damping], Field(min_length=1)])
#: Colours that differ also without red-green vision and in grey; more dampings repeat them.
_PALETTE = ("#0072B2", "#E69F00", "#009E73", "#4D4D4D", "#D55E00", "#CC79A7", "#56B4E9", "#882255")
#: Damping ratio where a study needs damping and the configuration has none.
_DAMPING_RATIO = 0.05
#: Panels of one figure, see `Basins` and `Poincare`.
_PANELS = 12
#: What describes the bodies of the gears: one without the others would not fit the reduced mass,
#: and bearings of other bodies would not fit these.
_BODIES = ("base_radii", "inertias", "masses")


def filled(mapping):
    """Return what was read from YAML with its defaults, and the context of its validation."""
    if not isinstance(mapping, dict):
        return mapping, {}
    pair, gears, dampings = _gears(mapping)
    context = {"pair": pair, "dampings": dampings, "drawn": gears is not None}
    defaults = _defaults_of(pair or _PAIR, dampings or _DAMPINGS)
    six_degrees = mapping.get("six_degrees") or {}
    if gears:
        defaults["resonance"] = _resonance(mapping.get("resonance"), pair, gears.speed)
        defaults["six_degrees"] = gears.six_degrees()
        if "bearing_stiffness" not in six_degrees:
            other_problems = [name for name in get_args(Problem) if name != "six_degrees"]
            defaults["work_precision"]["problems"] = other_problems
    elif isinstance(six_degrees, dict) and any(key in six_degrees for key in _BODIES):
        for key in (*_BODIES, "bearing_stiffness"):
            del defaults["six_degrees"][key]
    whole = laid_over(defaults, mapping)
    if "gears" in mapping:
        whole["gear_pair"] = pair or _PAIR
    figures = whole["figures"]
    if isinstance(figures, dict) and isinstance(figures["colours"], dict):
        figures["colours"] = _colours(dampings or _DAMPINGS, figures["colours"])
    return whole, context


def _gears(mapping):
    """Return the pair and the drawing of a configuration, and its dampings; None if refused."""
    pair, gears = None, None
    try:
        if "gears" in mapping:
            gears = Gears.model_validate(mapping["gears"])
            pair = GearPairSection(**gears.pair())
        else:
            pair = GearPairSection.model_validate(mapping.get("gear_pair"))
        context = {"pair": pair, "drawn": gears is not None}
        return pair, gears, _DAMPINGS_TYPE.validate_python(mapping.get("dampings"), context=context)
    except ValidationError:
        return pair, gears, None


def _resonance(section, pair, speed):
    """Return the default range of the resonance characteristic of drawn gears, with their speed."""
    section = section if isinstance(section, dict) else {}
    step = section.get("step", Resonance.model_fields["step"].default)
    if {"start", "stop"} & section.keys() or not isinstance(step, (int, float)) or not step > 0.0:
        return {}
    start, stop = Decimal("0.5"), Decimal("1.4")
    # Beyond 100 there are no tunings: the speed itself is wrong.
    if speed is not None and speed * tuning_per_rpm(pair) <= 100.0:
        tuning, step = Decimal(speed * tuning_per_rpm(pair)), Decimal(repr(step))
        steps_below, steps_above = (start - tuning) / step, (tuning - stop) / step
        # The first tuning stays above 0.
        start -= step * max(0, min(math.ceil(steps_below), math.ceil(start / step) - 1))
        stop += step * max(0, math.ceil(steps_above))
    return {"start": float(start), "stop": float(stop), "lowest": float(start) / 5.0}


def _defaults_of(pair, dampings):
    """Return every default that depends on the gears, in the shape of the configuration."""
    sums = {name: d.material_damping + d.backlash_damping for name, d in dampings.items()}
    first = {"damping": next((name for name in sums if sums[name] > 0.0), next(iter(sums)))}
    lightest = min(sums, key=lambda name: sums[name])
    frequency, deflection = pair.mean_eigenfrequency, pair.static_deflection
    moderate = 2.0 * _DAMPING_RATIO * pair.reduced_mass * frequency
    largest = max(max(d.material_damping, d.backlash_damping) for d in dampings.values())
    largest = largest or moderate
    # Only motions damped in contact settle wherever they start.
    settling = {name: d for name, d in dampings.items() if d.material_damping > 0.0}
    if not settling:
        damping = Damping(material_damping=moderate, backlash_damping=moderate)
        settling = {f"damping ratio {_DAMPING_RATIO:g}": damping}
    cubic = largest / (deflection * frequency) ** 2
    masses = 6.0 * pair.reduced_mass
    bearing = pair.max_stiffness / 40.0
    return {
        "phase_lag": {"material_dampings": [largest, largest / 100.0]},
        "nonlinear_damping": {"damping": largest},
        "six_degrees": {
            # 1 / m_red = Rb3^2 / J3 + Rb2^2 / J2 + 1 / m3 + 1 / m2
            "base_radii": [0.1, 0.1],
            "inertias": [3.0 * 0.1**2 * pair.reduced_mass] * 2,
            "masses": [masses] * 2,
            "bearing_stiffness": [bearing] * 4,
            "bearing_damping": [2.0 * 0.02 * math.sqrt(bearing * masses)] * 4,
            "eccentricities": [min(0.8 * deflection, 0.2 * pair.backlash)] * 2,
        },
        **{key: first for key in ("jump", "analytic_method", "run_ups", "tolerances")},
        "train_sweep": first,
        "branches": {"loci": first},
        "stability_chart": {"damping": lightest},
        "work_precision": {
            "damping": largest,
            "cubic_damping": cubic if math.isfinite(cubic) else largest,
        },
        "reducer": {
            **first,
            "support_stiffness": 2.5 * pair.max_stiffness,
            "pin_error": [deflection, 0.0],
            "backlashes": [0.25 * pair.backlash, pair.backlash, pair.backlash],
        },
        "basins": {"cases": _cases(settling, 0.72)},
        "bifurcation": {"damping": next(iter(settling.values()))},
        "poincare": {
            # Without damping nothing settles.
            "cases": [
                case | {"phase": 0.0, "settle": 300 if sums[name] else 0}
                for name, case in zip(dampings, _cases(dampings, 0.66), strict=False)
            ]
        },
        "figures": {"colours": {}},
    }


def _cases(dampings, tuning):
    """Return a case at a tuning for each of the first dampings."""
    return [
        {"title": f"tuning {tuning:.2f}, {name}"[:60], "tuning": tuning, "damping": damping}
        for name, damping in list(dampings.items())[:_PANELS]
    ]


def _colours(names, given):
    """Return the given colours, and others for the dampings that have none."""
    taken = {str(colour).upper() for colour in given.values()}
    free = itertools.cycle([colour for colour in _PALETTE if colour not in taken] or _PALETTE)
    return given | dict(zip((name for name in names if name not in given), free, strict=False))
