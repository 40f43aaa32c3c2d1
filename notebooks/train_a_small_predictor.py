# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # Training a small predictor
#
# The network that ships with the package was trained on a GPU. This is the same recipe at a size
# that two CPU cores finish within a minute: made-up objects, sentences about them, and a U-Net
# whose layers are steered by what the sentence says (FiLM). It is a toy: the numbers below show
# that it learns, not that it is of use.
#
# ## Words
# Clauses, embedded by the packaged sentence encoder, each with the E, nu and rho that it means.

# %%
import time
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import torch
from autophyx_tet.predictors import HintedEncoder, MiniLM, count_parameters
from autophyx_tet.research import CPU, build_text_table, save_text_table, train_film

start = time.process_time()
words = HintedEncoder(MiniLM(), plain=False)
table = build_text_table(np.random.default_rng(0), words.text, per_part=1)
save_text_table(Path("text.safetensors"), table)
print(f"{len(table.texts):,} clauses, such as", *map(repr, table.texts[:3]))

# %% [markdown]
# ## Training
# Forty steps of eight objects on a grid of 16 cells.

# %%
torch.set_num_threads(1)
config = replace(CPU, steps=40, batch=8, objects=32, text_batch=64, every=4)
trained = train_film(config, text=Path("text.safetensors"))
history = trained.history
first, last = history[0], history[-1]
seconds = time.process_time() - start
print(
    f"{count_parameters(trained.network):,} parameters, {trained.steps} steps, {seconds:.0f} CPU s"
)
print(f"loss {first['loss']:.3f} -> {last['loss']:.3f}")
assert last["loss"] < 0.5 * first["loss"]
assert seconds < 120  # of one core; a minute where nothing else runs

# %%
figure, (left, right) = plt.subplots(1, 2, figsize=(8, 3), dpi=80)
at = [row["step"] for row in history]
left.semilogy(at, [row["loss"] for row in history], "o-")
left.set(xlabel="step", ylabel="loss")
right.plot(at, [row["right"] for row in history], "o-")
right.set(xlabel="step", ylabel="share of voxels bound to the right clause", ylim=(0, 1))
figure.tight_layout()
