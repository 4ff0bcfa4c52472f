"""Status codes of runs, with messages that suggest a remedy."""

import numpy as np

from gearlib.data.variables import CONTACTS
from gearlib.engines.codes import (
    EVENT_LIMIT,
    JAMMED,
    NO_START,
    NOT_CONVERGED,
    OK,
    OVERFLOW,
    STALLED,
    UNRESOLVED,
)

MESSAGES = {
    OK: "the run is complete",
    EVENT_LIMIT: (
        "the run met more contact events in one mesh period than max_events allows: "
        "raise max_events, or the tuning (slow meshes bounce many times per period)"
    ),
    OVERFLOW: (
        "the motion grows without bound, beyond 1e8 times its start, backlash and static "
        "deflection: add damping or leave the parametric-resonance tongue"
    ),
    NOT_CONVERGED: (
        "the iterations of the contact force did not converge within a step: "
        'raise steps_per_period, or take method "exact" or "taylor"'
    ),
    STALLED: (
        "the step control required steps below the spacing of floating-point numbers: "
        'loosen the tolerances, or take method "exact" or "taylor"'
    ),
    JAMMED: (
        "deviations, run-out or moving bearings closed the backlash, so that both flanks of a mesh "
        "would touch at once: raise the backlash, take smaller deviations or stiffer bearings, or, "
        "with six degrees of freedom, moving_backlash=False"
    ),
    UNRESOLVED: (
        "the motion stayed so close to first contact that rounding hides whether the flanks touch: "
        'change the initial state or the tuning by a millionth, or take method "scipy"'
    ),
    NO_START: (
        "there is no initial state: no run ends there, or the run whose final state it would be "
        "failed, for which its own status gives the reason"
    ),
}


def flag_attributes(names, first_code=0):
    """Return the attributes flag_values and flag_meanings for a variable of integer codes.

    The codes are `first_code`, `first_code + 1`, ... in the order of `names`. Spaces and hyphens in
    names become underscores, as the CF conventions require for flag_meanings.
    """
    meanings = " ".join(name.replace(" ", "_").replace("-", "_") for name in names)
    codes = np.arange(first_code, first_code + len(names), dtype=np.int8)
    return {"flag_values": codes, "flag_meanings": meanings}


CONTACT_FLAGS = flag_attributes(CONTACTS, first_code=-1)
