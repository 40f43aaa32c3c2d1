"""Readers: the formats of assets, one file each, into named surfaces or a cloud.

In: the path and bytes of an asset, and the files beside it that it may refer to.
Out: an AssetContent: surfaces in the units of the file, and what the file says of unit and up axis.
Read: asset_formats, surface_scene, obj, ply_surface, gltf, threemf, collada, plain, carrier.
"""
