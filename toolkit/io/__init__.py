"""Files: assets and carriers read, documents and sidecars written.

In: paths that a user gives, with units and an up axis where the file has none.
Out: assets in metres, coloured grids, checked output paths, JSON documents.
Read: load, readers, references, units, clouds, coloured_grid, outputs, document, sidecar.
"""
