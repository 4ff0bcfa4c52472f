"""How a run ended, and what to do when it could not go on."""

import numpy as np

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
        "the iterations on the contact force did not come to rest within a step: "
        'raise steps_per_period, or take method "exact" or "taylor"'
    ),
    STALLED: (
        "the step control asked for steps below the spacing of floating-point numbers: "
        'loosen the tolerances, or take method "exact" or "taylor"'
    ),
    JAMMED: (
        "deviations, run-out or moving bearings closed the backlash, so that both flanks of a mesh "
        "would touch at once: raise the backlash, take smaller deviations or stiffer bearings, or, "
        "with six degrees of freedom, moving_backlash=False"
    ),
    UNRESOLVED: (
        "the motion kept so close to a flank line that rounding hides whether it crosses it: "
        'move the initial state or the tuning by a millionth, or take method "scipy"'
    ),
    NO_START: (
        "there is no start: no run ends there, or the run whose end it should be could not go on, "
        "and its own status says why"
    ),
}

#: CF flag attributes of every variable that holds a status.
FLAGS = {
    "flag_values": np.array(list(MESSAGES), dtype=np.int8),
    "flag_meanings": "ok event_limit unbounded not_converged stalled jammed unresolved no_start",
}


def flags_of(names):
    """Return the CF flags of a variable that says 0, 1, ... for these names."""
    meanings = " ".join(name.replace(" ", "_").replace("-", "_") for name in names)
    return {"flag_values": np.arange(len(names), dtype=np.int8), "flag_meanings": meanings}


def settled_flags(words):
    """Return the CF flags of a variable that says 0, unsettled, or 1, in these words."""
    return flags_of(("unsettled", words))
