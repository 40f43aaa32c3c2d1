"""Scenarios: what happens to a body, told by its name alone."""
