"""Contact: forces between the surface of a body and rigid obstacles.

In: the surface of a space, obstacles with a distance, a coefficient of friction.
Out: energy, forces and Hessian of barrier and friction; how far a step may go.
Read: barrier, sites, friction.
"""
