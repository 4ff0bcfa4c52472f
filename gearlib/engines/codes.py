"""Integer codes of all kernels: contact state of a mesh and status of a run."""

#: Contact states: drive-side flanks in contact, no contact, coast-side flanks in contact.
DRIVE, NO_CONTACT, COAST = 1, 0, -1
#: Contact on both sides at once, which no model supports: it ends a run with the status JAMMED.
BOTH = 2

#: Statuses of a run, explained in `gearlib.data.status`.
OK, EVENT_LIMIT, OVERFLOW, NOT_CONVERGED, STALLED, JAMMED, UNRESOLVED, NO_START = range(8)
