"""Cholesky: sparse matrices of 3 x 3 blocks factored by nested dissection, supernodes and fronts.

In: a BlockMatrix.
Out: a plan of its elimination with the cost, and the factor, which solves and counts pivots.
Read: elimination, factor.
"""
