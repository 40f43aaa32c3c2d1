"""The span tagger: which words of a text speak of which part, learned from made texts.

In: names of materials, lists of three languages, forms of texts as data.
Out: low-rank weights beside those of MiniLM.
Read: generator, recipe.
"""
