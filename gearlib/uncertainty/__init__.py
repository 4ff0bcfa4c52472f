"""Measured sets, fits of parameters, scatter of tolerances: `read_measured`, `fit`, `scatter`."""
