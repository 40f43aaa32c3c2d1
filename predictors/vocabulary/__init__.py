"""Vocabulary: every word that a text may use, before any sentence is read.

In: the material table, the words of English, what parts are called.
Out: which row, role or part a phrase names, a misspelt word mended, the tree of a sentence.
Read: model, lexicon, part_names, spelling.
"""
