"""Points with columns: clouds and Gaussian splats in all their files."""
