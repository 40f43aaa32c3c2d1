"""Command line: options are parsed, a verb is called, its document is shown.

In: the words of a call.
Out: the document as tables or JSON, one line for an error, an exit code.
Read: supervisor, main, commands, terminal.
"""
