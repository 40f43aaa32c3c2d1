"""UniPixie: what words leave open, from names and looks, by flow matching, from soft to stiff.

In: parts as voxels, their names, colours and features, and alpha, from soft (0) to stiff (1).
Out: E, nu, rho and class of every voxel, the range they lie in, and samples of what is plausible.
Read: predictor, network.
"""
