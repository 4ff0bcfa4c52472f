"""Computer-assisted proofs: existence, contacts and stability of orbits in ball arithmetic."""
