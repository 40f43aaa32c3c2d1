"""Hearing: what a network gets of a text: clauses as the vectors that it was trained with.

In: a text, the material table, the names that an asset has for its parts.
Out: a HeardSentence of HeardClauses, what they say of parts as vectors and channels.
Read: clauses, parser, tokens, vocabulary, words, binding, part_names, levels, statement, lexicon.
"""
