"""What an edge sample looks like in a view: crease, silhouette, occluding, or nothing usable."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.brep.refine.mesh import FaceMesh
from brepgaussian.brep.refine.samples import Rays
from brepgaussian.brep.structure import Structure
from brepgaussian.geometry.cameras import Cameras

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

CREASE, SILHOUETTE, OCCLUDING = 0, 1, 2
KINDS = ("crease", "silhouette", "occluding")
NEAR_PX, FAR_PX = 1.5, 4.5  # distances from the edge at which rays test what lies beside it
SLIVER_PX = (0.3, 0.8)  # and these tell whether it reaches up to the edge; the triangulation is good to .06 px
_DEPTH_PX = 12.0  # a hit this much nearer or farther than the sample, in pixel footprints, is another place
ASTRAY_PX = 2  # wrong pixels this far from a silhouette's border are no matter of precision
_NOTHING = -1


class Scene:
    """Ray casting against the present triangulation."""

    def __init__(self, mesh: FaceMesh) -> None:
        import open3d as o3d

        core: Any = o3d.core  # its stubs know no arrays
        self._tensor, self._mesh = core.Tensor, mesh
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        vertices, triangles = mesh.vertices.astype(np.float32), mesh.triangles.astype(np.uint32)
        self._scene.add_triangles(self._tensor(vertices), self._tensor(triangles))

    def cast(self, centers: Array, directions: Array) -> tuple[Indices, Array]:
        """(R,) face that each ray hits first (-1: none) and (R,) distance along its unit direction."""
        rays = self._tensor(np.concatenate([centers, directions], axis=1).astype(np.float32))
        answer = self._scene.cast_rays(rays, nthreads=1)
        distance = answer["t_hit"].numpy().astype(np.float64)
        triangle = answer["primitive_ids"].numpy().astype(np.int64)
        hit = np.isfinite(distance)
        return np.where(hit, self._mesh.face[np.where(hit, triangle, 0)], _NOTHING), distance


def look(cameras: Cameras, view: Indices, pixels: Array, poses: Array) -> tuple[Array, Array]:
    """(R, 3) camera centres and (R, 3) unit directions through pixels, each row in its own view."""
    center = cameras.intrinsics[view, 2:]
    shift = poses[view]
    arm = pixels - shift[:, :2] - center
    arm = arm - shift[:, 2:] * np.column_stack([-arm[:, 1], arm[:, 0]])
    local = np.column_stack([arm / cameras.intrinsics[view, :2], np.ones(len(view))])
    directions = np.einsum("rji,rj->ri", cameras.cam_from_unit[view][:, :3, :3], local)
    return cameras.centers[view], directions / np.linalg.norm(directions, axis=1, keepdims=True)


@dataclass(frozen=True)
class Seen:
    """Usable rays with the kind of their edge.

    The image normal points from the first surface to the second (crease), or away from the object or the
    occluder (silhouette, occluding).
    """

    rays: Rays
    kind: Indices  # (R,)


def classify(rays: Rays, scene: Scene, structure: Structure, cameras: Cameras, poses: Array) -> Seen:
    """Keep visible samples with nothing else within 4.5 px across the edge, and turn their normals."""
    surface_of = np.array([f.surface for f in structure.faces] + [_NOTHING - 1], np.int64)
    centers = cameras.centers[rays.view]
    depth = np.linalg.norm(rays.points - centers, axis=1)
    tolerance = _DEPTH_PX * depth / cameras.intrinsics[rays.view, :2].mean(axis=1)
    inside = _inside(rays, cameras)
    status, faces = [], []
    for side in (-1.0, 1.0):
        hits = []
        for reach in (NEAR_PX, FAR_PX):
            pixels = rays.pixel + side * reach * rays.normal
            face, distance = scene.cast(*look(cameras, rays.view, pixels, poses))
            hits.append((face, distance))
        (near, distance), (far, _) = hits
        owner = surface_of[near]
        contour = rays.sample < 0
        close = (np.abs(distance - depth) < tolerance) | contour
        own_first = (owner == rays.table[:, 0]) & close & (near >= 0)
        own_second = (owner == rays.table[:, 1]) & close & (near >= 0)
        behind = (near >= 0) & (distance > depth + tolerance)
        state = np.select([near < 0, own_first, own_second, behind], ["none", "first", "second", "behind"], "other")
        status.append(np.where(surface_of[far] == owner, state, "other"))
        faces.append(near)
    minus, plus = status
    owned = [np.isin(s, ("first", "second")) for s in status]
    crease = owned[0] & owned[1] & (minus != plus)
    kind = np.full(len(depth), -1)
    kind[crease] = CREASE
    for here, there in ((0, 1), (1, 0)):
        kind[owned[here] & (status[there] == "none")] = SILHOUETTE
        kind[owned[here] & (status[there] == "behind")] = OCCLUDING
    keep = (kind >= 0) & inside
    turn = np.where(crease, minus == "second", owned[1])
    owners = np.stack([surface_of[f] for f in faces])[:, keep]
    keep[keep] = _nothing_between(rays.take(keep), owners, scene, surface_of, cameras, poses)
    return Seen(rays.turned(turn).take(keep), kind[keep])


def _nothing_between(
    rays: Rays, owners: Indices, scene: Scene, surface_of: Indices, cameras: Cameras, poses: Array
) -> NDArray[np.bool_]:
    """Whether what lies at 1.5 px (2, R) on either side reaches up to the edge: no sliver of a third face."""
    clear = np.ones(len(rays.view), bool)
    for row, side in enumerate((-1.0, 1.0)):
        for reach in SLIVER_PX:
            left = np.flatnonzero(clear)
            part = rays.take(left)
            pixels = part.pixel + side * reach * part.normal
            face, _ = scene.cast(*look(cameras, part.view, pixels, poses))
            clear[left] = surface_of[face] == owners[row, left]
    return clear


def _inside(rays: Rays, cameras: Cameras) -> NDArray[np.bool_]:
    """Whether a profile across the edge lies within the image."""
    margin = FAR_PX + 1
    size = np.array([cameras.width, cameras.height])
    fits = (rays.pixel > margin) & (rays.pixel < size - margin)  # (R, 2)
    return fits[:, 0] & fits[:, 1]


@dataclass(frozen=True)
class Masks:
    """How a solid's silhouettes agree with the views' over all views together.

    Attributes:
        iou: intersection over union. All of a right solid's loss lies at pixels that the border halves, so it says
            more about the length of the borders than about what is missing.
        astray: share of the union's pixels that are wrong although no border of the view's silhouette is within
            `ASTRAY_PX`: a hole, a slot, a body that the solid lacks or has too much. None in a right solid.
    """

    iou: float
    astray: float


def compare_masks(
    scene: Scene, cameras: Cameras, alpha: NDArray[np.uint8], poses: Array, samples: int = 300_000
) -> Masks:
    """Compare the solid's silhouettes with the views' on a regular grid of pixels."""
    views = len(cameras)
    rows, columns = np.flatnonzero(alpha.max(axis=(0, 2))), np.flatnonzero(alpha.max(axis=(0, 1)))
    if len(rows) == 0:
        return Masks(0.0, 0.0)
    pad = 8  # the solid may reach a little beyond every silhouette
    low = np.maximum([rows[0] - pad, columns[0] - pad], 0)
    high = np.minimum([rows[-1] + pad, columns[-1] + pad], alpha.shape[1:])
    stride = max(1, int(np.ceil(np.sqrt(views * np.prod(high - low) / samples))))
    both = either = astray = 0
    for view in range(views):
        start = low + np.array([view % stride, view // stride % stride])  # another phase of the grid in every view
        y, x = np.meshgrid(np.arange(start[0], high[0], stride), np.arange(start[1], high[1], stride), indexing="ij")
        pixels = np.column_stack([x.ravel(), y.ravel()]) + 0.5
        face, _ = scene.cast(*look(cameras, np.full(len(pixels), view), pixels, poses))
        model, image = face >= 0, alpha[view, y.ravel(), x.ravel()] > 127
        both += int((model & image).sum())
        either += int((model | image).sum())
        wrong = model != image
        astray += _clear_of_borders(alpha[view] > 127, y.ravel()[wrong], x.ravel()[wrong])
    return Masks(both / max(either, 1), astray / max(either, 1))


def _clear_of_borders(mask: NDArray[np.bool_], rows: Indices, columns: Indices) -> int:
    """How many pixels have the value of all pixels around them."""
    around = np.arange(-ASTRAY_PX, ASTRAY_PX + 1)
    y = np.clip(rows[:, None, None] + around[:, None], 0, mask.shape[0] - 1)
    x = np.clip(columns[:, None, None] + around, 0, mask.shape[1] - 1)
    return int((mask[y, x] == mask[rows, columns][:, None, None]).all(axis=(1, 2)).sum())


def group_names(structure: Structure, groups: Indices) -> list[str]:
    """`edge 3` or `contour of face 2`."""
    edges = len(structure.edges)
    return [f"edge {g}" if g < edges else f"contour of face {g - edges}" for g in groups]
