"""Proofs about the reducer made of the paper's pair, with all six meshes.

Its branches are alike, and so is their motion, with contact in all meshes: at one tuning it is
stable, at the other it breaks, with two real multipliers beyond -1 that belong to motions of one
branch against the others.
"""

from gearlib.analysis.orbits.shooting import NoOrbit, periodic_orbit
from gearlib.analysis.proofs.orbits import certify
from gearlib.models.trains.ready_made import split_power_reducer

#: Teeth and tunings of the reducer: below the loss of symmetry, and in it.
REDUCER, ALIKE = (24, 36, 24, 36), (0.5, 0.6)


def compute(pair, rounded):
    """Yield (name of the train, tuning, certificate or refusal).

    pair: every mesh; rounded: rounds the states of orbits, see `gearlib.studies.certificates`.
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
