"""Many coordinates and several meshes, linear between events: matrix exponentials.

==========  ======================================
module      responsibility
==========  ======================================
``system``  what a train of gears is to the kernels
==========  ======================================
"""
