"""Data sets: procedural objects, real furniture as voxels, and clauses with what they ask for.

In: a seed; assets of real objects; an encoder of sentences, or a language model's endpoint.
Out: primitives of objects, labelled voxels, and one table of clauses with embeddings and values.
Read: shapes, categories, objects, wordings, frames, grammar, text_table, real, annotator.
"""
