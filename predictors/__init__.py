"""Predictors: appearance and text to a material field on a voxel grid.

In: an asset's parts as voxels, what is seen of them, and a sentence.
Out: E [Pa], nu [1] and rho [kg/m^3] of every cell, and why each part got what it got.
Read: assignment, predictor, prediction, language, lookup, retrieval, film, images, encoders.
"""
