"""Warp code of the material point method, made for a precision and for each class of matter.

In: a type of real numbers, a class, whether weights are those at rest.
Out: kernels, compiled on first use: a class that is not there costs nothing.
Read: kernels_stretch, kernels_laws, kernels_transfer, kernels_grid, kernels_survey.
"""
