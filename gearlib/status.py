"""How a run ended, and what to do when it could not go on."""

import numpy as np

from gearlib.core.run import EVENT_LIMIT, OK, OVERFLOW

MESSAGES = {
    OK: "the run is complete",
    EVENT_LIMIT: (
        "the run met more contact events in one mesh period than max_events allows: "
        "raise max_events, or the tuning (slow meshes bounce many times per period)"
    ),
    OVERFLOW: (
        "the motion grew beyond the range of floating-point numbers: "
        "add damping, leave the parametric-resonance tongue or run fewer periods"
    ),
}

#: CF flag attributes of every variable that holds a status.
FLAGS = {
    "flag_values": np.array(list(MESSAGES), dtype=np.int8),
    "flag_meanings": "ok event_limit overflow",
}
