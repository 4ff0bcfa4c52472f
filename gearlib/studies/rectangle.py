"""What the rectangular stiffness costs: the dynamics with the whole course beside that with it.

For each drawn pair and each method of its mesh stiffness the pair runs twice: with the course
C(tau), and with the rectangle of the same means in double and single contact. Their difference, in
every observable, is what the smallest model costs. Beside it stands the spread: how far the
rectangles of the other methods lie from that of the energy method. A difference that is lost in the
spread is no reason for a larger model.

Mass, load and damping coefficient of a pair are the same in all its runs, and all run at the same
speeds: tunings and displacements are counted in mean eigenfrequency and static deflection of the
energy method.
"""

import math

import numpy as np
import xarray as xr

from gearlib.data import provenance
from gearlib.data.lost_contact import lost_share
from gearlib.data.variables import describe
from gearlib.models.geometry import described_drawing
from gearlib.models.one_degree import OneDegreePair
from gearlib.models.pair import GearPair
from gearlib.models.profiles import Rectangular
from gearlib.runs.sweeping import CARRIED, sweep
from gearlib.studies.mesh_stiffness import METHODS, REFERENCE, by_method

FORMS = ("rectangle", "course")
#: Relative differences, of the last two those of shares; `characteristic` is the mean distance of
#: all heights over their mean, `motion` the share of motions of another period.
OBSERVABLES = (
    "peak_height",
    "peak_force",
    "jump_up",
    "jump_down",
    "characteristic",
    "contact_loss",
    "motion",
)
VERDICTS = ("negligible", "within the spread", "too large")

#: Rise of the height from tuning to tuning, in static deflections, that counts as a jump: the mesh
#: softens where it loses contact, so a resonance has its steep side at lower tunings.
JUMP = 0.3


def runs(pair, own, profile, tunings, run):
    """Return height, force, contact loss, period of one model, of shape (direction, tuning).

    pair: in whose mean eigenfrequency and static deflection tunings and heights are counted;
    tunings: shape (t,); run: periods, record_periods.
    """
    model = own if isinstance(profile, Rectangular) else OneDegreePair(pair=own, profile=profile)
    faster = pair.mean_eigenfrequency / own.mean_eigenfrequency
    larger = own.static_deflection / pair.static_deflection
    start = (own.mean_stiffness / own.max_stiffness, 0.0)
    found = [
        sweep(model, tunings * faster, initial_state=start, direction=direction, **run)
        for direction in CARRIED
    ]
    return {
        "orbit_height": [larger * (s.displacement_max - s.displacement_min).values for s in found],
        "dynamic_force": [s.dynamic_force_max.values for s in found],
        "lost_share": [lost_share(s.fraction_normal.values) for s in found],
        "period": [s.period.values for s in found],
    }


def observe(tunings, found):
    """Return observable -> value of what `runs` returns; NaN for a jump that is not there."""
    height = np.asarray(found["orbit_height"])
    values = {
        "peak_height": height.max(),
        "peak_force": np.max(found["dynamic_force"]),
        "contact_loss": np.mean(found["lost_share"]),
    }
    for name, row in zip(("jump_up", "jump_down"), height, strict=True):
        rises = np.diff(row)
        i = int(np.argmax(rises))
        values[name] = (tunings[i] + tunings[i + 1]) / 2.0 if rises[i] > JUMP else math.nan
    return values


def differences(tunings, found, base):
    """Return the differences of all `OBSERVABLES` of two results of `runs`, the second the base.

    Infinite where only one of both has a jump.
    """
    ours, theirs = observe(tunings, found), observe(tunings, base)
    heights = np.asarray(found["orbit_height"]), np.asarray(base["orbit_height"])
    result = {
        "characteristic": np.abs(heights[0] - heights[1]).mean() / heights[1].mean(),
        "contact_loss": abs(ours["contact_loss"] - theirs["contact_loss"]),
        "motion": np.not_equal(found["period"], base["period"]).mean(),
    }
    for name in OBSERVABLES:
        if name in result:
            continue
        if math.isnan(ours[name]) or math.isnan(theirs[name]):
            same = math.isnan(ours[name]) and math.isnan(theirs[name])
            result[name] = 0.0 if same else math.inf
        else:
            result[name] = abs(ours[name] - theirs[name]) / theirs[name]
    return np.array([result[name] for name in OBSERVABLES])


def verdict(cost, spread, tolerance):
    """Return the index in `VERDICTS`: negligible, or lost in the spread, or neither."""
    if cost <= tolerance:
        return 0
    return 1 if cost <= spread and math.isfinite(cost) else 2


def compute(pairs, tunings, samples, settings):
    """Return what the rectangle costs in every observable, beside the spread of the methods.

    pairs: as of `gearlib.studies.mesh_stiffness.compute`; tunings: shape (t,); samples: phases of
    the courses; settings: damping_ratio, tolerance, periods, record_periods.

    orbit_height, dynamic_force, lost_share, period over (pair, stiffness_method, form, direction,
    tuning); answer over (pair, stiffness_method, form, observable); rectangle_cost over (pair,
    stiffness_method, observable); method_spread and rectangle_verdict over (pair, observable), the
    latter by the largest cost of all methods.
    """
    tunings = np.asarray(tunings, float)
    run = {name: settings[name] for name in ("periods", "record_periods")}
    shape = len(pairs), len(METHODS), len(FORMS)
    curves = {
        name: np.empty((*shape, len(CARRIED), tunings.size), kind)
        for name, kind in (
            ("orbit_height", float),
            ("dynamic_force", float),
            ("lost_share", float),
            ("period", int),
        )
    }
    answers = np.full((*shape, len(OBSERVABLES)), np.nan)
    costs = np.empty((*shape[:2], len(OBSERVABLES)))
    spreads = np.empty((len(pairs), len(OBSERVABLES)))
    verdicts = np.empty(spreads.shape, object)
    for i, drawing in enumerate(pairs.values()):
        mesh, torque = described_drawing.mesh(drawing), drawing["torque"]
        stiffness = by_method(mesh, torque, samples)
        pair = GearPair.from_geometry(
            mesh, torque=torque, damping_ratio=settings["damping_ratio"], stiffness=REFERENCE
        ).replace(**stiffness[REFERENCE].ratios())
        found = {}
        for j, (name, one) in enumerate(stiffness.items()):
            own = pair.replace(**one.ratios())
            for k, profile in enumerate((Rectangular(), one.profile)):
                result = found[name, FORMS[k]] = runs(pair, own, profile, tunings, run)
                for key, values in result.items():
                    curves[key][i, j, k] = values
                seen = observe(tunings, result)
                answers[i, j, k] = [seen.get(key, math.nan) for key in OBSERVABLES]
            costs[i, j] = differences(tunings, found[name, "course"], found[name, "rectangle"])
        base = found[REFERENCE, "rectangle"]
        others = [found[name, "rectangle"] for name in METHODS if name != REFERENCE]
        spreads[i] = np.max([differences(tunings, other, base) for other in others], axis=0)
        verdicts[i] = [
            VERDICTS[verdict(cost, spread, settings["tolerance"])]
            for cost, spread in zip(costs[i].max(axis=0), spreads[i], strict=True)
        ]
    dims = ("pair", "stiffness_method", "form", "direction", "tuning")
    dataset = xr.Dataset(
        {
            **{name: (dims, values) for name, values in curves.items()},
            "answer": ((*dims[:3], "observable"), answers),
            "rectangle_cost": (("pair", "stiffness_method", "observable"), costs),
            "method_spread": (("pair", "observable"), spreads),
            "rectangle_verdict": (("pair", "observable"), verdicts.astype(str)),
            "tolerance": float(settings["tolerance"]),
        },
        {
            "pair": list(pairs),
            "stiffness_method": list(METHODS),
            "form": list(FORMS),
            "direction": list(CARRIED),
            "tuning": tunings,
            "observable": list(OBSERVABLES),
        },
    )
    dataset.attrs = provenance.attributes(
        "What the rectangular mesh stiffness costs",
        pair,
        method="exact, taylor",
        pairs=pairs,
        **settings,
    )
    dataset.attrs.pop("gear_pair")
    return describe(dataset)


def rows(costs):
    """Yield a row for each pair and observable: what the rectangle costs, beside the spread."""
    head = [f"{form} ({REFERENCE})" for form in FORMS]
    words = [f"difference, {name}" for name in costs.stiffness_method.values]
    yield ["pair", "observable", *head, *words, "spread", "verdict"]
    for pair in costs.pair.values:
        for name in costs.observable.values:
            one = costs.sel(pair=pair, observable=name)
            values = [
                *one.answer.sel(stiffness_method=REFERENCE).values,
                *one.rectangle_cost.values,
                float(one.method_spread),
            ]
            numbers = ["" if math.isnan(x) else f"{x:.4g}" for x in values]
            yield [pair, name, *numbers, one.rectangle_verdict.item()]
