"""Native engines: code that may hang or crash runs guarded, and its results are kept.

In: a task's name, arrays and options.
Out: arrays, from the cache where they were computed before, or a failure with its kind.
Read: guard, child, engines, cache, interrupts.
"""
