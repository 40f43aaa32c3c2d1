"""Ranges of matter that hold: proposed for an object, simulated at both ends, refined, counted.

In: objects with named parts; a table of matter, an endpoint, or files that a person edited.
Out: a log for every object with its range, rounds and outcome; shares, biases, a queue of reviews.
Read: proposal, actor, endpoint, probe, findings, agent, log, refinement, bias, critic, auditing.
"""
