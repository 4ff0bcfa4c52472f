"""Orbits that are theorems: existence, contacts and stability proven in ball arithmetic."""
