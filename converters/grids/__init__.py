"""Density grids of radiance fields."""
