"""Geometry of gears, and the parameters of their mesh; lengths in m, angles in rad.

A user takes these names from `gearlib.geometry`.
"""
