"""Spring-mass networks: anchors in the tets, joined by springs whose constants follow from E.

In: a Scene; how many anchors, how many neighbours each, eta, dashpots.
Out: a MotionResult on the mesh's points; scales of the springs fitted to another motion.
Read: network, body, motion, fit.
"""
