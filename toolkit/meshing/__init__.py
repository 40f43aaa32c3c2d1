"""Meshing: closed surfaces are filled with tets, and what the mesh keeps is proved.

In: an asset of named surfaces [m], or a file of tets.
Out: one watertight tet mesh [m] with a region a part, and its report.
Read: convert, guarantees, meshers, ftetwild, stuffing, messages.
"""
