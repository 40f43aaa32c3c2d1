"""The tables of the UniPixie supplement on our objects, the paper's own figures beside them.

In: a table of ranges (`dataset ranges`), how long to train, and how many objects are scored.
Out: the rows of S3, S5, S6 and S7, and of the heads of skinning and of springs beside constants.
Read: networks, joint, feedback, theta, springs.
"""
