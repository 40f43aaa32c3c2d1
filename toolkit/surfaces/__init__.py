"""Surfaces: triangle soups made fit for tetrahedra."""
