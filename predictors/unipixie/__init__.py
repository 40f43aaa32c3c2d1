"""Unipixie: voxel features in; by flow matching the matter of three solvers out, soft to stiff.

The network alone, so far: it has no weights, and no command uses it yet.

In: features, occupancy and places of voxels, and alpha, from soft (0) to stiff (1).
Out: E, nu, rho and class of every voxel, a skinning body with its E and nu, springs.
Read: config, layers, encoder, decoder, flow, network, simplicits.
"""
