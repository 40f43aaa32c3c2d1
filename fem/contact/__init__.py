"""Contact with obstacles: barrier and friction."""
