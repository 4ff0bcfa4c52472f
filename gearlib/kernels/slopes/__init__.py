"""What a piecewise-linear motion changes by: many coordinates, any number of directions.

====================  =============================================================================
module                responsibility
====================  =============================================================================
``bases``             coordinates in which the matrix of an arc and its slopes fall into blocks
``itinerary``         the arcs, crossings and switches of a motion, one after the other
``modal_turns``       coordinates of tangents along an arc
``through_arcs``      tangents along arcs, over flank lines and switches
``recorded_slopes``   derivatives of samples, events, extrema and shares of time
``turning_points``    where displacements and forces are largest, and touches of flank lines
====================  =============================================================================
"""
