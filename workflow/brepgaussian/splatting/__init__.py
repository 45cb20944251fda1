"""Two-stage 2D Gaussian Splatting: hull, differentiable renderer, geometry and edges, patch features."""
