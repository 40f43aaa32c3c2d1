"""Native engines, each in a guarded process, their results in a cache."""
