"""At the rig: measured curves.

====================  ========================================================
module                responsibility
====================  ========================================================
``measured``          `read_measured`: a measured set as one dataset in SI
``long_tables``       long tables, as PEtab has them, as columns
``measured_files``    CSV, UFF, MDF and MATLAB files as columns
``laid_over``         a set over the resonance characteristics of a model
``measured_courses``  time courses at constant speeds beside those of a model
``measured_orders``   mesh orders of run-ups beside those of a model
``measured_scores``   how far both agree, as a table
``measured_checks``   what columns are refused for, and what is repaired
====================  ========================================================
"""
