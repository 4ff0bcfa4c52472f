"""Kernels of the methods with steps, and the equations of motion that they solve."""
