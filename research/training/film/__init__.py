"""Training of the FiLM network: its batches, its loss and the runs behind the shipped weights.

In: stores of voxelised objects, clauses on the device, and a configuration.
Out: the trained network and its checkpoint.
Read: config, recipe, batch, mixture, sampler, augmentation, simulated_evidence, loss, presets.
"""
