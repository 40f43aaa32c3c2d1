"""Things in one piece: regions of like look, and which clause of a sentence speaks of each.

In: cells of a thing, how they look, and the clauses of a sentence.
Out: for every cell its region and its clause, and how surely.
Read: network, division.
"""
