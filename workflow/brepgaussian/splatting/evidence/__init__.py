"""What stage 1 knows beside its surfels: a 3D edge cloud, and surface that no two views see."""

from brepgaussian.splatting.evidence.creases import with_creases
from brepgaussian.splatting.evidence.edges import edge_cloud
from brepgaussian.splatting.evidence.observed import unobserved
from brepgaussian.splatting.evidence.rims import concavity_edges

__all__ = ["concavity_edges", "edge_cloud", "unobserved", "with_creases"]
