"""Studies of gear trains, one call for each.

===================  ==============================================================
module               responsibility
===================  ==============================================================
``stability``        chart of a planetary train: exact tongues, those of first order
``symmetry``         where symmetric motions of equal planets break
===================  ==============================================================
"""
