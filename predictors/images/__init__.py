"""Images: what an asset looks like, from pictures onto the cells of a grid.

In: an asset, photographs with cameras, or cells with density and colour.
Out: pictures; features of every cell inside and out; labels of cells by words.
Read: features, cameras, views, surface_colour, surface_voxels, lifting, filling, segmentation.
"""
