"""Lookup: what words settle, from the table alone, before any predictor is asked.

In: a HeardSentence, words of options, names of parts; the material table.
Out: a PartChoice for every part, settled or only the likeliest row.
Read: lookup, kernel.
"""
