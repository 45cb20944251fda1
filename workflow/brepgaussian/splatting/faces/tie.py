"""Surfels of confirmed fillets stay on them: prior and shading would pull them into the air of the corner.

Light that two faces throw at each other looks like another shape to the loss, and a quadric does not follow a quarter
of a turn; the views have found the fillet's radius with all rays together.
"""

from collections.abc import Sequence

import numpy as np

from brepgaussian.splatting.faces.fillets import Fillet
from brepgaussian.splatting.library import Floats

_REACH_VOXELS = 3.0  # from a fillet within which a surfel that faces as it does is one of its own
_FACING = np.cos(np.radians(60.0))


def tied(centers: Floats, normals: Floats, fillets: Sequence[Fillet], spacing: float) -> tuple[Floats, Floats]:
    """Centres and normals (N, 3) with those of the fillets' surfels exactly on these.

    Args:
        centers: unit frame; normals: outward unit normals.
        fillets: confirmed ones.
        spacing: edge of a voxel of the hull, unit frame.
    """
    places, facing = centers.astype(np.float64), normals.astype(np.float64)
    for fillet in fillets:
        edge, radius = fillet.edge, fillet.radius
        off = edge.off_axis(places, radius)
        distance = np.linalg.norm(off, axis=1)
        out = -off / np.maximum(distance, 1e-12)[:, None]
        along = (places - edge.point) @ edge.direction
        sector = out @ edge.bisector > edge.half_arc
        mine = (np.abs(distance - radius) < _REACH_VOXELS * spacing) & sector & (along >= edge.span[0])
        mine &= (along <= edge.span[1]) & (np.einsum("ij,ij->i", out, facing) > _FACING)
        places[mine] += (radius / distance[mine] - 1)[:, None] * off[mine]
        facing[mine] = out[mine]
    return places.astype(np.float32), facing.astype(np.float32)
