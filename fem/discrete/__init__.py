"""The body in finitely many numbers: spaces, sparse matrices, mass, forces, strains."""
