"""Runs of any model by any method.

========================  ==========================================================
module                    responsibility
========================  ==========================================================
``simulation``            `simulate`: one tuning, time course, events, orbit summary
``sweeping``              `sweep`: many tunings, orbit summaries
``run_up``                `run_up`: any course of speed and load
``sensitivities``         derivatives of what `simulate` returns by parameters
``variational``           maps of small deviations without the free rotation
``run_arguments``         arguments that all runs share, checked
========================  ==========================================================
"""
