"""Measured sets, fits to them, and what the tolerances of a drawing do.

========================  ===================================================================
module                    responsibility
========================  ===================================================================
``measured``              `read_measured`: a measured set as one dataset in SI
``measured_tables``       CSV and UFF files as columns, checked
``measured_comparison``   sweeps, time courses and run-ups beside those of a model
``measured_scores``       how far both agree, as a table
``fits``                  `fit`: parameters by least squares
``fit_report``            values, intervals, what the data do not tell
``observation``           measured values and the function that predicts them
``observations``          slow sweeps and speeds of jumps as observations
``course_observations``   time courses and run-ups as observations
``orbit_values``          what a sensor may show of a model at a speed
``synthetic_rigs``        measured sets of a known model
``distributions``         how parameters scatter: limits, deviations, named distributions
``quality_classes``       tolerances by the classes that a drawing names
``designs``               samples of the parameters and their models
``design_quantities``     jumps, onset, peak and duty point of each design
``scatter``               `scatter`, its shards, bands over speed
``indices``               `sobol_indices`, with bootstrapped intervals
``tolerance_study``       what the workflow asks of them
========================  ===================================================================
"""
