"""Lookup: what words settle, from the table alone, before any predictor is asked.

In: a Sentence, words and numbers of options, names of parts; the material table.
Out: a PartChoice for every part, settled or only the likeliest, and what to warn of.
Read: lookup, numbers, similarity.
"""
