"""Patches for tests of changes to a solid."""

from brepgaussian.brep.patches import Patch


def patches_of(surfaces, clouds):
    """One patch for each surface and its points (N, 3)."""
    return [
        Patch(s, k, x, s.normals(x).copy(), 0.02, 0.002) for k, (s, x) in enumerate(zip(surfaces, clouds, strict=True))
    ]
