"""From tables of numbers to named datasets and files.

====================  ========================================================
module                responsibility
====================  ========================================================
``variables``         names, units and descriptions of every variable
``duty_variables``    the same of duty points and order spectra
``fit_variables``     the same of fits
``measured_names``    what may be measured
``layout_variables``  the same of where the gears of a train lie
``contact_states``    flank lines, phases of contact and their codes
``lost_contact``      whether contact is lost, by the share of time in contact
``summary``           from the summary table of the kernels to named variables
``growing``           curves without motions that grow beyond all use
``motion_words``      whether a motion is steady and where it settles, in words
``status``            how a run ended, and what to do when it could not go on
``provenance``        what a dataset says of its own making
``numbers_given``     what a caller gives as numbers, as an array
``storage``           datasets to and from netCDF
``files``             whole files or none
``result``            results of a computation as one described dataset
``gathering``         shards of the workflow into one dataset per experiment
====================  ========================================================
"""
