"""One degree of freedom, linear damping, rectangular stiffness: closed forms between events."""
