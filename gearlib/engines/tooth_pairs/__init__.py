"""One mesh whose pairs of teeth touch one by one: linear between events, a flank line for each.

======================  =============================================================
module                  responsibility
======================  =============================================================
``tooth_pairs_system``  the tables of such a mesh at one tuning
``tooth_pairs_run``     steps to the next event, whole runs, maps of small deviations
======================  =============================================================
"""
