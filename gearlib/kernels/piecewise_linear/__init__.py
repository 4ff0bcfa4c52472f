"""Many coordinates, linear between events: matrix exponentials.

=================  ====================================================
module             responsibility
=================  ====================================================
``system``         matrices and Taylor series of a system
``whole_periods``  the periods before the record, by precomputed tables
``run``            from event to event, and a whole run
``variation``      growth of small deviations over mesh periods
=================  ====================================================
"""
