"""Periodic orbits, their branches over a parameter, special points and the main resonance."""
