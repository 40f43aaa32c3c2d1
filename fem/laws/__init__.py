"""Elastic laws on the device: energy, stress and second derivative of a density."""
