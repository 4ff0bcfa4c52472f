"""Kernels of the step-by-step methods, and the equations of motion that they solve."""
