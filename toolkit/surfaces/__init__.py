"""Surfaces: triangle soups are repaired, and told apart into solids and sheets.

In: the triangles [m] of an asset's parts, however broken.
Out: closed shells wound outward, and the part that any point lies in.
Read: triangles, surface, welding, orientation, repair, solids, offset, decimate, samples.
"""
