"""Material point method: explicit MLS-MPM for what bends, flows, breaks or falls apart.

In: particles with a class, E, nu, rho and what their class yields at; walls, forces, a duration.
Out: where the particles go, or a Failure with its time, part and advice.
Read: materials, particles, boundaries, time_step, solver, kernels_transfer.
"""
