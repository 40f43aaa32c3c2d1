"""Walls: parts of a mesh that are hollow, though no element shows it.

In: a mesh [m] with the material of its parts, what options, names and the text say of them.
Out: how each part is built, its mass as an interval [kg], the apparent material of a smeared wall.
Read: wall_options, part_words, stated_walls, built_parts.
"""
