"""Contact: forces between the surface of a body, rigid obstacles and the body itself.

In: the surface of a space, obstacles with a distance, a coefficient of friction.
Out: energy, forces and Hessian of barrier and friction; how far a step may go.
Read: barrier, sites, friction, self_contact, collision_mesh, pressure, foothold.
"""
