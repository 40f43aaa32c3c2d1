"""Language: a text read once, as clauses that say what of an object is what.

In: a text, the material table, the names that an asset has for its parts.
Out: a Sentence of Clauses and of unread words; which clauses speak of which part.
Read: clauses, reader, groups, grammar, drafts, binding.
"""
