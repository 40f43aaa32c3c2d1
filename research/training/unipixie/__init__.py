"""Training of the UniPixie network: its batches, its loss and the run behind the shipped weights.

In: procedural and real objects, a table of ranges, and a configuration.
Out: the trained network and its checkpoint.
Read: config, names_on_device, batch, sampler, loss, recipe, regression, range_scores.
"""
