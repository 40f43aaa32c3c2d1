"""Scenarios: what happens to a body, told by a name and a few numbers.

In: a mesh with a material, the axis that points up, the scenario's options.
Out: a Scene and the name of its method; the functions sag, hang, wind, poke, drop, squeeze.
Read: scenario, sag, hang, wind, poke, drop, squeeze, vibration.
"""
