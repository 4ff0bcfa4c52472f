"""Trials of the methods: which is right, at what cost, and where each fails."""
