"""Training of the FiLM network: samples, loss, trainer."""
