"""Evaluation: how good predictions are, against baselines."""
