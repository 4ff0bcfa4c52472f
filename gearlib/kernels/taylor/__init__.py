"""Nonlinear mesh of one degree of freedom: Taylor steps that end at events.

===================  =================================================
module               responsibility
===================  =================================================
``series``           Taylor series of the motion
``taylor_run``       steps from event to event, and a whole run
``taylor_tangents``  series of small deviations, and of their sources
``taylor_maps``      maps of mesh periods, tangents, what maps change by
``taylor_record``    derivatives of what a run records
===================  =================================================
"""
