"""Verdict: what a verb did, in numbers for JSON and sentences for people.

In: the results of a conversion, an assignment or a simulation.
Out: documents with facts, checks and warnings; advice that names options.
Read: verdict, assignment, simulation, run, reduction.
"""
