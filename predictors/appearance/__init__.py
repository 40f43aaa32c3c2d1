"""Appearance: pictures of an asset, and what their features say of every voxel.

In: surfaces with textures, splats, or photographs with cameras.
Out: colours and features in the voxels of a grid, parts that look alike.
Read: views, features, segmentation.
"""
