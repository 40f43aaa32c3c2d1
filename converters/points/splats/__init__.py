"""Splats: what the columns of 3D Gaussians mean, their packed files, and the body they cover.

In: a table with the columns of splats, or a file that packs them.
Out: Gaussians in plain units, columns of the common PLY, an opacity grid, a closed surface.
Read: gaussians, packed_ply, rows, spz, ksplat, opacity_surface, covariances, harmonics.
"""
