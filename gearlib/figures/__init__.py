"""Figures: one module each, functions that take computed data and return a `Figure`."""
