"""Discrete: the body in finitely many numbers.

In: a mesh, a law, supports and loads.
Out: nodes, block matrices, elastic energy and forces, masses, strains and stresses.
Read: space, assembly, block_matrix, elastic, constraints, forces, mass, strain.
"""
