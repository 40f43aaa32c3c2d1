"""Training and test data: procedural objects, real furniture, and sentences about them."""
