"""FiLM: the text-conditioned 3D U-Net of AutoPhyX, each clause bound to the cells it speaks of.

In: parts as voxels, a Sentence and as a network hears it, colours and features of the cells.
Out: E [Pa], nu [1], rho [kg/m^3] of every cell, and how surely each clause speaks of it.
Read: predictor, unet.
"""
