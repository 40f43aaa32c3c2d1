"""Simulation: a mesh with a material, a scenario and what is stated of it, to an answer in files.

In: a mesh, options of the scenario, supports and loads in words, a carrier that shall move too.
Out: a Simulation that settled, moves or rings; its files, page and picture.
Read: simulate, scenario, reducing.
"""
