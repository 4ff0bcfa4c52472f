"""One mesh whose pairs of teeth touch one by one: linear between events, a flank line for each.

====================  =============================================================================
module                responsibility
====================  =============================================================================
``system``            the tables of such a mesh at one tuning
``run``               steps to the next event, whole runs, maps of small deviations
====================  =============================================================================
"""
