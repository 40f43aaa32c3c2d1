"""Lexemes: a text as tokens, each with what it does in a sentence and what it says.

In: a text, the lexicon, the names that an asset has for its parts.
Out: Lexemes: part names, materials, numbers, connectors, words; comparisons and pointers resolved.
Read: lexeme, spans, lexing, ranges, comparisons, bare_numbers, pointers, treatments.
"""
