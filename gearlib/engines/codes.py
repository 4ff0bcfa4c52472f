"""Codes that all kernels share: the contact of a mesh, and how a run ended."""

#: Drive side in contact (the paper's normal mesh), no contact, coast side (inverse mesh).
NORMAL, BACKLASH, INVERSE = 1, 0, -1
#: Both sides at once, of which the models say nothing: what an event leads to, never a contact.
BOTH = 2

#: `gearlib.data.status` says what each means and what to do.
OK, EVENT_LIMIT, OVERFLOW, NOT_CONVERGED, STALLED, JAMMED, UNRESOLVED, NO_START = range(8)
