"""The scene: a body of tets with its material, what holds it, what it meets."""
