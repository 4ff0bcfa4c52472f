"""Named datasets and files: names and units, results, netCDF, CSV and HTML.

==================  ===============================================================
module              responsibility
==================  ===============================================================
``variables``       names, units and descriptions of every variable
``measured_names``  the same of quantities that are measured
``status``          codes of how a run ended, and what to do when it could not go on
``summary``         variables of an orbit from the summary table of an engine
``motions``         contact loss, growth and settling of the motion in a dataset
``result``          the dataset of a computation, with its origin in the attributes
``gathering``       one dataset for each experiment from the shards of the workflow
``files``           files written in one step, CSV and HTML tables, hash of the sources
``storage``         datasets to and from netCDF and CSV
==================  ===============================================================
"""
