"""Toolkit: the verbs of the package, from a file and a sentence to a mesh, a motion and a page.

In: an asset, words and options, from Python or from the command line.
Out: meshes, fields, motions, reports and one JSON document a verb.
Read: pipeline, options, asset, meshing, simulation, verdict, report, batch, cli.
"""
