"""Which models the methods with steps take."""

MODELS = "one degree of freedom, any damping, stiffness and excitation"


def takes(pair):
    """Return whether the model is one mesh with one degree of freedom."""
    return pair.one_mesh
