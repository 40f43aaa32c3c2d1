"""Datasets: objects with the material of every voxel.

In: recipes of shapes, or catalogues of real assets.
Out: stores of examples for the trainers.
Read: objects, real, text_table, audit.
"""
