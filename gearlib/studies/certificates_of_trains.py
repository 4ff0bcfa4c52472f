"""What is proven of trains made of the paper's pair: the reducer with all six meshes, an idler.

Of the reducer whose branches are alike the motion in which they move alike, with contact in all
meshes: at one tuning it is stable, at the other it breaks, with two real multipliers beyond -1
that belong to motions of one branch against the others. Of an idler between unequal gears the first
loss of contact over the tuning, a grazing, and the fold behind it.
"""

import numpy as np

from gearlib.analysis.orbits.continuation import continue_orbit
from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.orbits.special_points import DOUBLING, FOLD, GRAZING
from gearlib.analysis.proofs.orbits import certify
from gearlib.analysis.proofs.points import certify_fold, certify_grazing
from gearlib.models.trains.ready_made import idler
from gearlib.models.trains.reducer_train import split_power_reducer

#: Teeth and tunings of the reducer: below the loss of symmetry, and in it.
REDUCER, ALIKE = (24, 36, 24, 36), (0.5, 0.6)
#: Teeth of the idler, from which tuning it is followed to which, in which steps.
IDLER, FROM, TO, STEP, POINTS = (24, 36, 30), 0.6, 0.7, 0.2, 20


def compute(pair, rounded, rounded_branch):
    """Yield (name of the train, tuning, certificate or refusal).

    Parameters
    ----------
    pair : GearPair
        Every mesh.
    rounded, rounded_branch : callable
        Of orbits and of branches, see `gearlib.studies.certificates`.
    """
    reducer = split_power_reducer(pair, teeth=REDUCER)
    for tuning in ALIKE:
        try:
            orbit = periodic_orbit(
                reducer, tuning, guess=reducer.start_state("static"), period=reducer.repeats
            )
        except NoOrbit:
            continue
        yield "reducer", tuning, certify(rounded(orbit))
    yield from idler_points(pair, rounded_branch)


def idler_points(pair, rounded_branch):
    """Yield the same of the special points of the idler."""
    train = idler(pair, teeth=IDLER)
    try:
        orbit = periodic_orbit(train, FROM, period=train.repeats)
    except NoOrbit:
        return
    branch = rounded_branch(continue_orbit(orbit, to=TO, step=STEP, max_points=POINTS))
    for point in np.flatnonzero(np.isin(branch.label.values, (FOLD, DOUBLING, GRAZING))):
        prove = certify_grazing if branch.label[point] == GRAZING else certify_fold
        yield "idler", float(branch.tuning[point]), prove(train, branch, int(point))
