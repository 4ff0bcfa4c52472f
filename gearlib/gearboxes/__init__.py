"""Gearboxes from REXS files: their stages, their loads, and the whole gearbox as a gear train."""
