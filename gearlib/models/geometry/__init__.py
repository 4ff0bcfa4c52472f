"""Geometry of gears and the parameters of their mesh; lengths in m, angles in rad.

The public names are in `gearlib.geometry`.
"""
