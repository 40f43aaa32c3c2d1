"""Damping: forces that brake a motion, of its velocity and of the rate of its strain.

In: a discretised body with a material, where it was and where it is.
Out: forces, the energy whose minimum they are in a step, its second derivative.
Read: rayleigh, viscosity, kernels_viscosity.
"""
