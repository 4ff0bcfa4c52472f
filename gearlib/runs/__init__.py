"""Runs of any model by any method.

=================  ==========================================================
module             responsibility
=================  ==========================================================
``simulation``     `simulate`: one tuning, time course, events, orbit summary
``sweeping``       `sweep`: many tunings, orbit summaries
``variational``    maps of small deviations over mesh periods
``run_arguments``  arguments that all runs share, checked
=================  ==========================================================
"""
