"""Gear trains: what only the whole machine shows.

===================  ===============================================================
module               responsibility
===================  ===============================================================
``motions``          where motions from many starts end: what all of them share
``reducer``          all meshes of the paper's reducer over speed, with errors
``one_mesh``         whether one mesh stands for the reducer
``train_stability``  chart of a planetary train: exact tongues, those of first order
``symmetry``         where symmetric motions of equal planets break
``over_speed``       every mesh of the train of the configuration over speed
``campbell``         Campbell diagram of the reducer, and where its meshes part
===================  ===============================================================
"""
