"""Results: what the verbs return, each with the JSON document that it prints.

In: meshes, fields and answers of the solvers.
Out: conversion, assignment, simulation and run, with verdicts in plain words.
Read: conversion, assignment, verdict, description, settled, moving, ringing, run, reduction.
"""
