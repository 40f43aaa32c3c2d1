"""Retrieval: the material of every part from the table, nothing trained."""
