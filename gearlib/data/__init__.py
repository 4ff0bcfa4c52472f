"""Named datasets and files: names and units, results, netCDF, CSV and HTML.

==================  ===============================================================
module              responsibility
==================  ===============================================================
``variables``       names, units and descriptions of all variables
``measured_names``  names, units and descriptions of measured quantities
``status``          codes of how a run ended, and what to do when it could not go on
``summary``         summary variables of orbits from the table of an engine
``motions``         contact loss, growth and settling of the motion in a dataset
``result``          the dataset of a computation, with its origin in the attributes
``gathering``       one dataset for each experiment from the shards of the workflow
``files``           atomic writing of files, CSV and HTML tables, hash of the sources
``storage``         reading and writing of datasets as netCDF and CSV
==================  ===============================================================
"""
