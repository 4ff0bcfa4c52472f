"""Figures: a module for each subject, functions that take computed data and return a `Figure`."""
