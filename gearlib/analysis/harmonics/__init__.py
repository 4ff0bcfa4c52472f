"""Periodic motions over harmonics: the paper's analytic method, and harmonic balance beside it."""
