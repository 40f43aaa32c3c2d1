"""FiLM: the text-conditioned 3D U-Net of AutoPhyX."""
