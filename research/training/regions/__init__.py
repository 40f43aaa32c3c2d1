"""Training of the region network: which clause of a sentence speaks of which region of a thing.

In: a file of ``dataset regions``.
Out: weights for ``predictors.regions``, with the calibration of their certainty.
Read: recipe, sampler, network.
"""
