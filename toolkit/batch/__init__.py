"""Batch: many assets, each in a process of its own, resumable whatever is killed.

In: a manifest (CSV), one asset and its sentence a row.
Out: a folder a row, one table (CSV, JSON) and one page.
Read: manifest, task, batch, table.
"""
