"""Edge maps and patch masks of calibrated images (the paper's 2D label extraction)."""
