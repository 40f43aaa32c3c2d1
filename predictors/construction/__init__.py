"""Construction: is a closed part solid, or a wall around something; what does it weigh at least.

In: the words and measures of a part, the clauses of a sentence, what options say.
Out: a wall [m] and a filling [kg/m^3] as intervals, and why; or that nothing decides.
Read: kinds, construction, masses.
"""
