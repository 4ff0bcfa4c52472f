"""Parametric resonance: where the motion without loss of contact is unstable."""
