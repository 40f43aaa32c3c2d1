"""Grids: the densities of radiance fields in files, and the closed surfaces that they cut.

In: a DensityGrid [1/m] on a box [m] with further arrays, or a file of one.
Out: the file, the grid, or the surface at its threshold.
Read: density, density_file, density_archive, nanovdb, nerfacc, instant_ngp, isosurface.
"""
