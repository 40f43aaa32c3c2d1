"""A field or a mesh to and from every carrier: tets, points, splats, grids, solver files."""
