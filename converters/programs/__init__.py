"""Programs: the files of other solvers and engines, one file a program.

In: a TetMesh with a material, and what its scene needs: up axis, gravity [m/s^2], supports.
Out: the files of the program, how many bins of material, and what they do not hold.
Read: export, material_bins, calculix, newton, mujoco, usd, sofa, fenics.
"""
