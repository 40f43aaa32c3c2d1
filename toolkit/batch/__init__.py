"""Many assets: a manifest in, a folder and a table out."""
