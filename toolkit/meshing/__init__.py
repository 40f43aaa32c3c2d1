"""Meshing: surfaces to one watertight tet mesh, and the proof of what it keeps."""
