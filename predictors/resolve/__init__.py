"""Resolve: what words decide of each part, before a network fills in what they leave open.

In: clauses bound to parts, names of parts, and the table of materials.
Out: a row, E, nu and rho for every part that words decide; the others are left open.
Read: resolve, numbers, similarity.
"""
