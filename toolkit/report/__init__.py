"""Report: one offline page about a mesh and its motion, and the pictures in it.

In: the result of a run or of a simulation.
Out: HTML that loads nothing from elsewhere; PNG, GIF and WebP pictures.
Read: pages, html, picture.
"""
