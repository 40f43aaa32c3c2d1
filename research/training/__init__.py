"""Training: one trainer for any network, sampler and loss, and a folder for each network.

In: files of clauses and of real objects, and a configuration.
Out: a checkpoint of the averaged weights, and a state from which a run goes on exactly.
Read: options, trainer, state, processes, sentences, stores, real_slots, film, encoder.
"""
