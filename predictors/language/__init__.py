"""Language: a sentence as clauses, and which part each one speaks of."""
