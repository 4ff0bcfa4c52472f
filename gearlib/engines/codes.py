"""Codes that all kernels share: contact of a mesh and status of a run."""

#: Drive-side flanks in contact (the paper's normal mesh), no contact, coast-side flanks in contact
#: (its inverse mesh).
DRIVE, NO_CONTACT, COAST = 1, 0, -1
#: Contact of both sides at once, which no model describes; an event to it ends a run as JAMMED.
BOTH = 2

#: Statuses of a run, which `gearlib.data.status` explains.
OK, EVENT_LIMIT, OVERFLOW, NOT_CONVERGED, STALLED, JAMMED, UNRESOLVED, NO_START = range(8)
