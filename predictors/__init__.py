"""Appearance and text to a material field on a voxel grid."""
