"""Images: pictures of an asset, and what is seen lifted onto voxels."""
