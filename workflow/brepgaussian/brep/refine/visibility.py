"""What an edge sample looks like in a view: crease, silhouette, occluding, or nothing usable."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.views import CLEAR, OPAQUE
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
_SIDES = (-1.0, 1.0)  # of an edge, along its image normal
_NONE, _FIRST, _SECOND, _BEHIND, _OTHER = range(5)  # what lies on a side


class Scene:
    """Ray casting against the present triangulation."""

    def __init__(self, mesh: FaceMesh) -> None:
        import open3d as o3d

        core: Any = o3d.core  # its stubs know no arrays
        self._tensor, self.mesh = core.Tensor, mesh
        self._scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        vertices, triangles = mesh.vertices.astype(np.float32), mesh.triangles.astype(np.uint32)
        self._scene.add_triangles(self._tensor(vertices), self._tensor(triangles))

    @property
    def face(self) -> Indices:
        """(T,) face of each triangle."""
        return self.mesh.face

    @cached_property
    def normals(self) -> Array:
        """(T, 3) unit normals of the triangles."""
        a, b, c = (self.mesh.vertices[self.mesh.triangles[:, k]] for k in range(3))
        cross = np.cross(b - a, c - a)
        return np.asarray(cross / np.maximum(np.linalg.norm(cross, axis=1, keepdims=True), np.finfo(float).tiny))

    def hit(self, centers: Array, directions: Array) -> tuple[Indices, Array]:
        """(R,) triangle that each ray hits first (-1: none) and (R,) distance along its unit direction."""
        rays = np.empty((len(centers), 6), np.float32)
        rays[:, :3], rays[:, 3:] = centers, directions
        answer = self._scene.cast_rays(self._tensor(rays), nthreads=1)
        distance = answer["t_hit"].numpy().astype(np.float64)
        triangle = answer["primitive_ids"].numpy().astype(np.int64)
        return np.where(np.isfinite(distance), triangle, _NOTHING), distance

    def cast(self, centers: Array, directions: Array) -> tuple[Indices, Array]:
        """(R,) face that each ray hits first (-1: none) and (R,) distance along its unit direction."""
        triangle, distance = self.hit(centers, directions)
        return np.where(triangle >= 0, self.mesh.face[np.maximum(triangle, 0)], _NOTHING), distance


def look(cameras: Cameras, view: Indices, pixels: Array, poses: Array) -> tuple[Array, Array]:
    """(R, 3) camera centres and (R, 3) unit directions through pixels, each row in its own view."""
    intrinsics, shift = cameras.intrinsics.take(view, axis=0), poses.take(view, axis=0)
    first, second, third = (cameras.cam_from_unit[:, k, :3] for k in range(3))  # (V, 3) rows of the rotations
    arm = pixels - shift[:, :2] - intrinsics[:, 2:]
    arm = arm - shift[:, 2:] * np.column_stack([-arm[:, 1], arm[:, 0]])
    arm /= intrinsics[:, :2]
    directions = arm[:, :1] * first.take(view, axis=0)  # millions of rays: no (R, 3, 3) table of rotations
    directions += arm[:, 1:] * second.take(view, axis=0)
    directions += third.take(view, axis=0)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return cameras.centers.take(view, axis=0), directions


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
    left = np.flatnonzero(_inside(rays, cameras))  # rays are cast only for what is still in question
    states, owners = np.full((2, len(left)), _OTHER), np.zeros((2, len(left)), np.int64)
    for row, side in enumerate(_SIDES):
        face, distance = _beside(rays, left, side * NEAR_PX, scene, cameras, poses)
        owners[row] = surface_of[face]
        states[row] = _state(rays, left, face, distance, owners[row], cameras)
        some = states[row] != _OTHER
        left, states, owners = left[some], states[:, some], owners[:, some]
    kind = _kind(states)
    some = kind >= 0
    left, kind, states, owners = left[some], kind[some], states[:, some], owners[:, some]
    for reach in (FAR_PX, *SLIVER_PX):  # up to the edge and clear of it the same surface: no sliver of a third face
        for row, side in enumerate(_SIDES):
            face, _ = _beside(rays, left, side * reach, scene, cameras, poses)
            same = surface_of[face] == owners[row]
            left, kind, states, owners = left[same], kind[same], states[:, same], owners[:, same]
    turn = np.where(kind == CREASE, states[0] == _SECOND, _owned(states[1]))
    return Seen(rays.take(left).turned(turn), kind)


def _beside(
    rays: Rays, rows: Indices, distance: float, scene: Scene, cameras: Cameras, poses: Array
) -> tuple[Indices, Array]:
    """Face (-1: none) that some rows' views show `distance` px beside the edge, and how far from the camera."""
    pixels = rays.pixel[rows] + distance * rays.normal[rows]
    return scene.cast(*look(cameras, rays.view[rows], pixels, poses))


def _state(rays: Rays, rows: Indices, face: Indices, distance: Array, owner: Indices, cameras: Cameras) -> Indices:
    """What lies on one side of an edge: nothing, one of its surfaces, something behind it, or something else."""
    view, table = rays.view[rows], rays.table[rows]
    depth = np.linalg.norm(rays.points[rows] - cameras.centers[view], axis=1)
    tolerance = _DEPTH_PX * depth / cameras.intrinsics[view, :2].mean(axis=1)
    hit = face >= 0
    close = hit & ((np.abs(distance - depth) < tolerance) | (rays.sample[rows] < 0))
    behind = hit & (distance > depth + tolerance)
    tests = [~hit, close & (owner == table[:, 0]), close & (owner == table[:, 1]), behind]
    return np.select(tests, [_NONE, _FIRST, _SECOND, _BEHIND], _OTHER)


def _owned(state: Indices) -> NDArray[np.bool_]:
    return (state == _FIRST) | (state == _SECOND)


def _kind(states: Indices) -> Indices:
    """(R,) kind of edge by the (2, R) states of its sides, -1 where it is not usable."""
    owned = [_owned(s) for s in states]
    kind = np.full(states.shape[1], -1)
    kind[owned[0] & owned[1] & (states[0] != states[1])] = CREASE
    for here, there in ((0, 1), (1, 0)):
        kind[owned[here] & (states[there] == _NONE)] = SILHOUETTE
        kind[owned[here] & (states[there] == _BEHIND)] = OCCLUDING
    return kind


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
        pixels: of the union that were compared.
    """

    iou: float
    astray: float
    pixels: int


def compare_masks(
    scene: Scene, cameras: Cameras, alpha: NDArray[np.uint8], poses: Array, samples: int = 300_000
) -> Masks:
    """Compare the solid's silhouettes with the views' on a regular grid of pixels."""
    views = len(cameras)
    rows, columns = np.flatnonzero(alpha.max(axis=(0, 2))), np.flatnonzero(alpha.max(axis=(0, 1)))
    if len(rows) == 0:
        return Masks(0.0, 0.0, 0)
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
        astray += _clear_of_borders(alpha[view], y.ravel()[wrong], x.ravel()[wrong])
    return Masks(both / max(either, 1), astray / max(either, 1), either)


def _clear_of_borders(alpha: NDArray[np.uint8], rows: Indices, columns: Indices) -> int:
    """How many pixels are surely object, or surely none, as all pixels around them are.

    A sliver of background that is thinner than a pixel, through a slot seen askance, is a border, too.
    """
    around = np.arange(-ASTRAY_PX, ASTRAY_PX + 1)
    y = np.clip(rows[:, None, None] + around[:, None], 0, alpha.shape[0] - 1)
    x = np.clip(columns[:, None, None] + around, 0, alpha.shape[1] - 1)
    window = alpha[y, x]
    return int(((window >= OPAQUE).all(axis=(1, 2)) | (window <= CLEAR).all(axis=(1, 2))).sum())


def group_names(structure: Structure, groups: Indices) -> list[str]:
    """`edge 3` or `contour of face 2`."""
    edges = len(structure.edges)
    return [f"edge {g}" if g < edges else f"contour of face {g - edges}" for g in groups]
