"""Encoders of text and images into one space."""
