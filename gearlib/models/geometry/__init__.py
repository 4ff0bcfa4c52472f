"""From the drawing to the parameters of a mesh: gears, their mesh, its stiffness, in SI units.

======================  =======================================================================
module                  responsibility
======================  =======================================================================
``blank``               `Material`, `Rack`, `Web`: what a gear is made of and cut with
``relief``              `TipRelief` and `PathTable`: by how much flanks lie back
``gear``                `SpurGear`: diameters, thicknesses, inertia; undercut, pointed tips
``mesh``                `Mesh`: contact ratio, path of contact, backlash, interference
``tooth``               outline of a tooth, its compliance and that of the body
``iso``                 mesh stiffness after ISO 6336-1, method B
``energy``              mesh stiffness by the energy method
``drawn_stiffness``     `MeshStiffness`: a named choice of both or of a table, and its reduction
``load_sharing``        how the pairs of teeth share the load, exactly
``transmission_error``  the static transmission error, and the relief that flattens it
``iso_dynamic_factor``  K_v after ISO 6336-1, method B
``drawn_parameters``    from a mesh, its load and damping to the parameters of a model
``planets``             sun, planets and ring: whether they can be put together
``described_drawing``   gears from plain values; what is refused by other names
``involute``            the involute function and its inverse
======================  =======================================================================

Lengths are in m, angles in rad; a user takes these names from `gearlib.geometry`.
"""
