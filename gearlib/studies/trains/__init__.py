"""Gear trains: what only the whole machine shows.

===================  ===============================================================
module               responsibility
===================  ===============================================================
``motions``          where motions from many starts end: what all of them share
``reducer``          all meshes of the paper's reducer over speed, with errors
``over_speed``       every mesh of the train of the configuration over speed
``campbell``         Campbell diagram of the reducer, and where its meshes part
===================  ===============================================================
"""
