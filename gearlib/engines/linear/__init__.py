"""Many coordinates and several meshes, linear between events: modes of contact combinations."""
