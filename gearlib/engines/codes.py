"""Integer codes that all kernels share: the contact of a mesh and the status of a run."""

#: Drive-side flanks in contact (the paper's normal mesh), no contact, coast-side flanks in contact
#: (its inverse mesh).
DRIVE, NO_CONTACT, COAST = 1, 0, -1
#: Contact on both sides at once, which no model describes: it ends a run with the status JAMMED.
BOTH = 2

#: Statuses of a run, which `gearlib.data.status` explains.
OK, EVENT_LIMIT, OVERFLOW, NOT_CONVERGED, STALLED, JAMMED, UNRESOLVED, NO_START = range(8)
