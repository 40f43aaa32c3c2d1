"""The energy of a motion beside what it was given.

In: a motion of any method and its scene. Out: what was given, made of nothing and lost; verdicts.
Read: balance, energy_verdicts.
"""
