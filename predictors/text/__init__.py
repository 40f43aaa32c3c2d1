"""Text: what a sentence says of the parts, read once.

In: a sentence and the names of the parts.
Out: clauses with materials, numbers, walls and loads, and what was not understood.
Read: reader, lexing, materials, parts, numerals, english, clauses, tagger, interpreter.
"""
