"""Solve: methods that turn a scene into a result, and the solvers they are made of.

In: a Scene, or its mesh, supports and loads.
Out: a StaticResult, SagResult, MotionResult or Modes; gradients for torch.
Read: method, equilibrium, statics, nonlinear, dynamics, schemes, modal.
"""
