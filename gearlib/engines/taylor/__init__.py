"""One degree of freedom, any damping, stiffness and excitation: Taylor steps that end at events."""
