"""Elements: the discrete body: shape functions, assembled matrices, internal and outer forces.

In: a mesh with E, nu, rho on every tet and a law.
Out: sparse matrices, nodal forces, strains and stresses; warp kernels in kernels_*.
Read: space, elastic, assembly, forces.
"""
