"""Evaluation: how good predictions are on objects and wordings never trained on, beside baselines.

In: names of predictors, and held-out objects or a folder of one's own with true values.
Out: a row of metrics for each predictor, with bootstrap intervals; errors of masses.
Read: rows, held_out, held_out_evaluation, metrics, ablations, baselines, folder_evaluation, paper.
"""
