"""The energy of a motion beside what it was given, and other verdicts on motions.

In: a motion of any method and its scene. Out: what was given, made of nothing and lost; verdicts.
Read: balance, energy_verdicts, motion_verdicts.
"""
