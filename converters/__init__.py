"""Converters: a field or a mesh to and from every carrier, by formats that say what they keep.

In: files of meshes, points and density grids; a material field [SI]; a mesh with E, nu, rho a tet.
Out: the same in other files, for other programs, or as fields, voxels and values a tet.
Read: registry, mesh, grids, points, material_sampling, carriers, embedding, driving, programs.
"""
