"""Named datasets and files: names and units, results, netCDF, CSV and HTML.

==================  ===============================================================
module              responsibility
==================  ===============================================================
``variables``       names, units and descriptions of all variables
``measured_names``  names, units and descriptions of measured quantities
``status``          status codes of runs, with messages that suggest remedies
``summary``         summary variables of runs from the summary table of an engine
``motions``         contact loss, growth and settling of the motion in a dataset
``result``          datasets of results, with their origin in the attributes
``gathering``       joins shards of the workflow to one dataset per experiment
``files``           atomic writing of files, CSV and HTML tables, source hash
``storage``         reads and writes datasets as netCDF and CSV
==================  ===============================================================
"""
