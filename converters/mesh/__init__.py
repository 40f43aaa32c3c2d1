"""Meshes: tet meshes in files, with regions, material and further arrays.

In: a TetMesh [m] with arrays on its points and tets, or a file of one.
Out: the file, or a MeshData with all that was in it.
Read: meshdata, msh, vtk, gltf_motion.
"""
