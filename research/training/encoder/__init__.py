"""Training of the image encoder: rendered objects in words, and a head fitted in closed form.

In: assets with the names of what they are, and a frozen network.
Out: a corpus of pictures in one file, and the weights of the head.
Read: corpus, pictures, head.
"""
