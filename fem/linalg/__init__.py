"""Linalg: linear systems of 3 x 3 blocks, factored where that fills little, else preconditioned.

In: a BlockMatrix, a right-hand side, positions of the nodes.
Out: the solution with its residual; a factor or a preconditioner to keep.
Read: solver, multigrid, krylov.
"""
