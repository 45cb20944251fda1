"""All prismatic concavities under the planes of a hull."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.artifacts.views import Views
from brepgaussian.splatting.concave.depth import measure
from brepgaussian.splatting.concave.openings import is_framed, openings, rectify
from brepgaussian.splatting.concave.planes import PlanarRegion, planar_regions
from brepgaussian.splatting.concave.prism import Prism
from brepgaussian.splatting.concave.scene import Scene

_NOISE_FREE_TOLERANCE = 3.0  # grey levels: a face's own grey varies by 1-2, some neighbours differ by 4
_SIGMAS = 3.0
_MAXIMUM_CELLS = 160_000  # per plane: a larger plane gets a coarser lattice
_PITCH_PIXELS = 1.25  # a cell a little larger than a pixel's footprint
_LEAST_WIDTH_PIXELS = 7.0  # narrower openings are not told from blur
_LEAST_DEPTH_CELLS = 3.0
_PARALLEL = 0.999  # cosine of 2.5 degrees
_MAXIMUM_ERROR = 0.16  # balanced share of rays against the depth: .00-.13 on true ones, .5 is chance

logger = log.get_logger("stage1")


def find_prisms(
    views: Views,
    vertices: NDArray[np.float64],
    triangles: NDArray[np.int64],
    cell: float,
    noise: float = 0.0,
    known: Sequence[Prism] = (),
) -> list[Prism]:
    """Find pockets, blind holes and holes under the planar faces of a hull.

    Args:
        views: images and cameras.
        vertices: (K, 3) and triangles: (T, 3): the hull's mesh, counter-clockwise from outside.
        cell: the hull's resolution.
        noise: standard deviation of the images' noise, grey levels.
        known: concavities that are already carved into the hull. If there are any, only their floors are
            looked at: their walls are no lids.
    """
    scene = Scene(vertices, triangles)
    luminance = views.luminance
    footprint = views.cameras.footprint()
    tolerance = max(_NOISE_FREE_TOLERANCE, _SIGMAS * noise)
    found: list[Prism] = []
    for region in planar_regions(vertices, triangles, 2 * cell):
        if known and not _is_floor(region, known, 2 * cell):
            continue
        lattice = region.lattice(vertices, triangles, _PITCH_PIXELS * footprint)
        if np.prod(lattice.shape) > _MAXIMUM_CELLS:
            coarser = lattice.pitch * np.sqrt(np.prod(lattice.shape) / _MAXIMUM_CELLS)
            lattice = region.lattice(vertices, triangles, coarser)
        stack = rectify(views, luminance, scene, lattice, tolerance)
        outlines = openings(stack, (_LEAST_WIDTH_PIXELS * footprint) ** 2)
        for outline in outlines:
            if is_framed(stack, outline):
                prism = measure(stack, outline, views.cameras.centers)
                if prism is not None and _believable(prism):
                    found.append(prism)
    return found


def _is_floor(region: PlanarRegion, known: Sequence[Prism], tolerance: float) -> bool:
    """Whether a planar region is the floor of a known concavity."""
    for prism in known:
        along = float(region.normal @ prism.lattice.normal)
        center = region.offset * region.normal  # the plane's point nearest to the frame's origin
        height = float((prism.lattice.origin - center) @ prism.lattice.normal)
        if along > _PARALLEL and abs(height - prism.depth) < tolerance and not prism.through:
            return True
    return False


def _believable(prism: Prism) -> bool:
    good = prism.error <= _MAXIMUM_ERROR and prism.depth >= _LEAST_DEPTH_CELLS * prism.lattice.pitch
    logger.info(
        "opening of area %.4f, normal %s: depth %.4f, %s, %.0f %% of rays against it%s",
        prism.area,
        np.round(prism.lattice.normal, 2).tolist(),
        prism.depth,
        "through" if prism.through else "blind",
        100 * prism.error,
        "" if good else ": not believed",
    )
    return good
