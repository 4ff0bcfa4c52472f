"""Periodic motions as Fourier series: the paper's analytic method, and harmonic balance."""
