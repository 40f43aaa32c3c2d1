"""Quantities: numbers of a text with their units, in SI.

In: a text.
Out: E, nu, rho, hardness, infill, mass, thickness and shares of fibres, each with its place.
Read: quantity, numerals, number_words.
"""
