"""Isosurface stuffing: a body-centred cubic lattice, warped and cut to what the solids bound.

In: solids [m], and how many tets or how long a lattice edge [m] are wanted.
Out: tets with a part each and dihedral angles of 9 to 166 degrees, the same ones every time.
Read: mesher, lattice, pieces.
"""
