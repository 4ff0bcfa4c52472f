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

from gearlib.data.lost_contact import lost_share
from gearlib.data.result import result, stacked
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
    periods = np.asarray(found["period"]), np.asarray(base["period"])
    # Of motions that have not settled none is known.
    settled = (periods[0] > 0) & (periods[1] > 0)
    result = {
        "characteristic": np.abs(heights[0] - heights[1]).mean() / heights[1].mean(),
        "contact_loss": abs(ours["contact_loss"] - theirs["contact_loss"]),
        "motion": (settled & (periods[0] != periods[1])).mean(),
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

    The verdict is by the largest cost of all methods.
    """
    tunings, found = np.asarray(tunings, float), {}
    run = {name: settings[name] for name in ("periods", "record_periods")}
    for drawing, words in pairs.items():
        mesh, torque = described_drawing.mesh(words), words["torque"]
        stiffness = by_method(mesh, torque, samples)
        pair = GearPair.from_geometry(
            mesh, torque=torque, damping_ratio=settings["damping_ratio"], stiffness=REFERENCE
        ).replace(**stiffness[REFERENCE].ratios())
        for name, one in stiffness.items():
            own = pair.replace(**one.ratios())
            for form, profile in zip(FORMS, (Rectangular(), one.profile), strict=True):
                found[drawing, name, form] = runs(pair, own, profile, tunings, run)

    def answers(*place):
        seen = observe(tunings, found[place])
        return {"answer": np.array([seen.get(key, math.nan) for key in OBSERVABLES])}

    def costs(drawing, name):
        course, rectangle = (found[drawing, name, form] for form in ("course", "rectangle"))
        return {"rectangle_cost": differences(tunings, course, rectangle)}

    def verdicts(drawing):
        others = [found[drawing, name, "rectangle"] for name in METHODS if name != REFERENCE]
        base = found[drawing, REFERENCE, "rectangle"]
        spreads = np.max([differences(tunings, other, base) for other in others], axis=0)
        largest = np.max([costs(drawing, name)["rectangle_cost"] for name in METHODS], axis=0)
        said = [
            VERDICTS[verdict(cost, spread, settings["tolerance"])]
            for cost, spread in zip(largest, spreads, strict=True)
        ]
        return {"method_spread": spreads, "rectangle_verdict": np.array(said)}

    each = {"pair": list(pairs)}
    methods = each | {"stiffness_method": list(METHODS)}
    axes = methods | {"form": list(FORMS)}
    data = (
        stacked(axes, lambda *place: found[place], "direction", "tuning")
        | stacked(axes, answers, "observable")
        | stacked(methods, costs, "observable")
        | stacked(each, verdicts, "observable")
        | {"tolerance": float(settings["tolerance"])}
    )
    own = {"direction": list(CARRIED), "tuning": tunings, "observable": list(OBSERVABLES)}
    title = "What the rectangular mesh stiffness costs"
    said = {"method": "exact, taylor", "pairs": pairs, **settings}
    dataset = result(title, pair, data, axes | own, **said)
    dataset.attrs.pop("gear_pair")
    return dataset


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
