"""Verdict: what a verb did, in numbers for JSON and sentences for people.

In: the results of a conversion, an assignment or a simulation.
Out: checks (does it hold its shape, buckle, tip over?), documents, advice that names options.
Read: checks, check, assignment, simulation, run.
"""
