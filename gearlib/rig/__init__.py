"""At the rig: measured curves, fits to them, synthetic rigs.

=========================  ==================================================================
module                     responsibility
=========================  ==================================================================
``measured``               `read_measured`: a measured set as one dataset in SI
``long_tables``            long tables, as PEtab has them, as columns
``measured_files``         CSV and UFF files as columns
``laid_over``              a set over the resonance characteristics of a model
``measured_courses``       time courses at constant speeds beside those of a model
``measured_orders``        mesh orders of run-ups beside those of a model
``measured_scores``        how far both agree, as a table
``measured_checks``        what columns are refused for, and what is repaired
``fits``                   `fit`: parameters by least squares
``observations``           what of measured sets can be compared
``fitted_data``            what a fit refuses of its data
``fitted_curves``          what was compared, as curves that can be drawn
``identifiability``        which parameters the data determine, and why others are not known
``fit_report``             values, intervals, the report
``order_observations``     what is compared of time courses: mesh orders
``run_up_observations``    the same of a run-up, and its jumps
``steady_observations``    the same at constant speed
``speed_observations``     what is compared of slow sweeps: speeds of jumps, onset of contact loss
``branch_observations``    what is compared of slow sweeps: statistics, load sharing, mesh orders
``orbit_at_speed``         an orbit at a speed and what is measured of it
``projection``             gain and offset of a sensor, eliminated
``synthetic_rigs``         what sensors would have of a known model
=========================  ==================================================================
"""
