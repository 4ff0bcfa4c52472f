"""Nonlinear mesh of one degree of freedom: Taylor steps that end at events.

===============  ===========================================
module           responsibility
===============  ===========================================
``series``       Taylor series of the motion
``taylor_run``   steps from event to event, and a whole run
``taylor_maps``  maps of mesh periods for small deviations
===============  ===========================================
"""
