"""What a thing is made of by its looks, for clauses of matter and no part ("the metal is zinc").

In: cells with colour, opacity and finish, and which clauses speak of matter.
Out: how much likelier each kind of matter is in each piece, and shares of the clauses dealt anew.
Read: evidence, looks, pieces.
"""
