"""At the rig: measured curves.

====================  ========================================================
module                responsibility
====================  ========================================================
``measured``          `read_measured`: a measured set as one dataset in SI
``long_tables``       long tables, as PEtab has them, as columns
``measured_files``    CSV, UFF, MDF and MATLAB files as columns
``measured_checks``   what columns are refused for, and what is repaired
====================  ========================================================
"""
