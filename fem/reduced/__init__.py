"""Reduced models: a body that moves in few coordinates, its elasticity summed over few cells.

In: a mesh with E, nu, rho and what holds it; for a motion, the scene.
Out: a ReducedModel, and motions of it by the same steps as those of the full body.
Read: model, elasticity, basis, cubature, motion, sweep.
"""
