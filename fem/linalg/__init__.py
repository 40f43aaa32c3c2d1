"""Linear systems of 3 x 3 blocks: direct where small, preconditioned where large."""
