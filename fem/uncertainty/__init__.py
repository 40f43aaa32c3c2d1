"""Uncertainty: what open ranges of E, nu and rho leave open in mass, displacement and frequencies.

In: a scene with its answer, the rows of the table and the draws of a predictor, by part.
Out: the lowest and highest answer, and the middle nine tenths of many bodies.
Read: ranges, intervals, lattice, likely.
"""
