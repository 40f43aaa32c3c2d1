"""Language: a sentence as clauses, what each says, and which part it speaks of.

In: a text, the material table, the names that an asset has for its parts.
Out: a Sentence of Clauses, their binding to parts, their levels and materials as numbers.
Read: clauses, parser, tokens, vocabulary, words, binding, part_names, levels, statement, lexicon.
"""
