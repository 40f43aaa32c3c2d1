"""Boundary conditions as a user states them: what is held, pushed, pressed, turned and moved.

In: sentences such as 'part:head=0,0,-10', a TOML file of them, and the Scene of a scenario.
Out: the Scene with these supports and loads, or an error that names parts and bounds.
Read: selection, boundary_conditions, conditions_file.
"""
