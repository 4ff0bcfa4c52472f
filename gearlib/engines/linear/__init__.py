"""Many coordinates and several meshes, linear between events: modes of every combination."""
