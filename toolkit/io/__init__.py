"""Files: assets are read, documents and sidecars written, outputs checked before the work.

In: a path to an asset of any format, or a result.
Out: an asset in metres, a JSON document.
Read: load, references, document, sidecar, outputs.
"""
