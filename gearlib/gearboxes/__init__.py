"""Gearboxes from REXS files: their stages, their loads, and the whole box as a gear train."""
