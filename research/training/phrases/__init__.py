"""Training of the phrase network: which row of the table some words of matter mean.

In: the table, patterns of standards, nouns of languages, words of marked texts.
Out: ``phrases.safetensors``.
Read: recipe.
"""
