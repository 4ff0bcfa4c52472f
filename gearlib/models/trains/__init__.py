"""Gear trains: any number of bodies, shafts and meshes as one piecewise-linear model."""
