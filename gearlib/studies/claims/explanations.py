"""Why the statements come out as they do: tongues, folds, grazings and multipliers, in words.

Every sentence is made from computed facts: the branches of periodic orbits behind Fig. 3
(`gearlib.studies.resonance_branches`) and the tongues of parametric resonance
(`gearlib.analysis.tongues`). A statement that follows from arithmetic, or of which these facts say
nothing, has no explanation.
"""

import math
from collections.abc import Callable
from functools import partial

import numpy as np

from gearlib.analysis.orbits.special_points import FOLD, GRAZING
from gearlib.analysis.tongues import meissner
from gearlib.studies.claims.data import READING, NoData

#: An extremum this close to a flank line, in static deflections, touches it.
_TOUCH = 1e-6
#: Multipliers this close to the unit circle lie on it; far above the rounding of their orbits.
_ON_CIRCLE = 1e-6

#: Products of multipliers that are this close to 1 are 1.
_ROUNDING = 1e-9


class Facts:
    """What branches and tongues say, asked for by what a sentence needs."""

    def __init__(self, data, tongues, branches):
        self.data, self.tongues, self.branches = data, tongues, branches

    def branch(self, name):
        """Return the branches of period one of a damping."""
        if name not in self.branches:
            raise NoData(f"no branch of {name} is there")
        found = self.branches[name]
        return found.isel(point=found.period.values == 1)

    def grazings(self, name):
        """Return the tunings at which the orbits touch the flank y = 0, ascending."""
        branch = self.branch(name)
        here = (branch.label.values == GRAZING) & (abs(branch.displacement_min.values) < _TOUCH)
        return np.unique(branch.tuning.values[here])

    def folds(self, name):
        """Return the tunings of the folds, ascending."""
        branch = self.branch(name)
        return np.unique(branch.tuning.values[branch.label.values == FOLD])

    def largest_multiplier(self, name, tuning):
        """Return the modulus of the largest multiplier of the orbit without loss at a tuning.

        Of a damping that damps nothing in contact.
        """
        branch = self.branch(name)
        kept = np.flatnonzero(branch.displacement_min.values > _TOUCH)
        if not kept.size:
            raise NoData(f"no orbit of {name} keeps contact")
        nearest = kept[abs(branch.tuning.values[kept] - tuning).argmin()]
        if abs(branch.tuning.values[nearest] - tuning) > READING:
            raise NoData(f"no orbit of {name} keeps contact near nu = {tuning:g}")
        # There the mesh is linear; at the tuning itself, not at the point of the branch beside it.
        ratios = self.data.pair.contact_ratio, self.data.pair.stiffness_ratio
        return math.exp(float(meissner.growth(*ratios, 0.0, tuning)))

    def loss_and_return(self, name):
        """Return the tunings at which the forced orbit loses contact near 0.8, and regains it."""
        grazings = self.grazings(name)
        lost = grazings[(grazings > 0.7) & (grazings < 0.9)]
        regained = grazings[grazings > 1.0]
        if not (lost.size and regained.size):
            raise NoData(f"the orbits of {name} do not lose contact near 0.8")
        return float(lost[0]), float(regained[-1])


def _multipliers(point):
    return point.multiplier_real.values + 1j * point.multiplier_imaginary.values


def _singular_region(facts):
    return facts.tongues.attrs["explanation"]


def _forced_loss(facts):
    name = facts.data.names(False, False)[0]
    lost, _ = facts.loss_and_return(name)
    product = np.prod(_multipliers(facts.branch(name)), axis=-1)
    # At grazings there are none.
    miss = float(np.nanmax(abs(abs(product) - 1.0)))
    # How far rounding goes is no number of the orbits.
    within = "to rounding" if miss < _ROUNDING else f"within {miss:.0e}"
    folds = facts.folds(name)
    upper = folds[folds > lost]
    fold = f", and the branch folds back at {upper[0]:.6g}" if upper.size else ""
    return (
        f"forced response: the orbit without loss of contact touches the flank at nu = {lost:.6g}"
        f"{fold}; undamped, the product of the multipliers is 1 ({within}), so that no "
        "motion settles"
    )


def _damped_range(facts):
    words = []
    for name in facts.data.names(material=True):
        lost, regained = facts.loss_and_return(name)
        folds = facts.folds(name)
        text = f"{name}: the orbit loses contact at nu = {lost:.6g} and keeps it again from "
        text += f"{regained:.6g}"
        if folds.size:
            text += (
                f"; folds at {', '.join(f'{x:.6g}' for x in folds)}: two orbits side by side, with "
                f"and without bounces, between {folds[0]:.6g} and {folds[-1]:.6g}"
            )
        words.append(text)
    return "; ".join(words)


def _undamped_contact(facts):
    (oil,) = facts.data.names(False, True)[:1]
    _, regained = facts.loss_and_return(oil)
    high = regained + READING
    modulus = facts.largest_multiplier(oil, high)
    others = [facts.loss_and_return(name)[1] for name in facts.data.names(material=True)]
    return (
        f"{oil}: an orbit without bounces exists from nu = {regained:.6g} only (the others: "
        f"{', '.join(f'{x:.6g}' for x in others)}), and there its largest multiplier has modulus "
        f"{modulus:.6g}: without damping in contact, motions beside it are not drawn onto it"
    )


def _settling(facts, tunings):
    (oil,) = facts.data.names(False, True)[:1]
    words = []
    for tuning in tunings:
        modulus = facts.largest_multiplier(oil, tuning)
        what = "neither grow nor decay" if abs(modulus - 1.0) < _ON_CIRCLE else "grow"
        words.append(f"{tuning:.2f}: largest multiplier {modulus:.6g}, deviations {what}")
    return f"{oil} damps nothing while contact lasts; orbit without loss at nu = {'; '.join(words)}"


def _jump(facts):
    name = facts.data.names(True, False)[0]
    folds = facts.folds(name)
    lost, _ = facts.loss_and_return(name)
    upper = folds[folds > lost]
    if not upper.size:
        raise NoData(f"the branch of {name} has no fold above its loss of contact")
    jump = float(facts.data.jump.jump[0])
    if np.isnan(jump):
        raise NoData("the motion from rest does not jump in the scan")
    return (
        f"the orbit with small bounces exists up to the fold at nu = {upper[-1]:.9g}; from rest "
        f"the motion leaves it at {jump:.7g} already, where rest passes the boundary of its basin"
    )


def _six_degrees(facts):
    return (
        "parametric resonance as with one degree of freedom: " + facts.tongues.attrs["explanation"]
    )


def _share_at_max(facts):
    return "the segment of C_max lasts epsilon - 1 of a mesh period"


#: id of the statement -> sentence from the facts.
EXPLANATIONS: dict[str, Callable] = {
    "P4": _singular_region,
    "P5": _forced_loss,
    "P6": _damped_range,
    "P7": _undamped_contact,
    "P8": _share_at_max,
    "P9": _forced_loss,
    "P10": partial(_settling, tunings=(0.60, 0.66, 0.78)),
    "P11": _jump,
    "P13": _six_degrees,
}


def explain(identifier, facts):
    """Return the explanation of a statement, empty where there is none or no data for it."""
    if identifier not in EXPLANATIONS:
        return ""
    try:
        return EXPLANATIONS[identifier](facts)
    except NoData:
        return ""
