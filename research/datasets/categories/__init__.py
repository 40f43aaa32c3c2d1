"""Categories: a function for each kind of thing, which builds one of random proportions.

In: a random generator.
Out: a solid of named parts, made of boxes, rods, balls and rings; z is up.
Read: furniture, tools, containers, clothing, vehicles, household, plants.
"""
