"""Training of the phrase network: which row of the table some words of matter mean."""
