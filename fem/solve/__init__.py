"""Methods: from a body with loads to its rest, motion, vibrations or gradients."""
