"""Results: what the verbs return."""
