"""Linalg: linear systems of 3 x 3 blocks, direct where small, preconditioned where large.

In: a BlockMatrix, a right-hand side, positions of the nodes.
Out: the solution with its residual; a preconditioner to keep.
Read: solver, two_level, coarse, aggregation, krylov, reused.
"""
