"""Cut off what a hull has above the planar faces that the images confirm."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian.artifacts.views import OPAQUE, Views
from brepgaussian.log import get_logger
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.prism import Prism, over
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces.align import Aligned, Stack, align, parallel
from brepgaussian.splatting.faces.candidates import candidates
from brepgaussian.splatting.faces.confirm import Face, confirm, in_doubt
from brepgaussian.splatting.faces.holes import clear_holes, standing

Array = NDArray[np.float64]
Sampler = Callable[[Array, NDArray[np.int64]], tuple[Array, Array]]

_SLACK_CELLS = 2.0  # a bulge is cut this much higher than its samples reach
_NEEDED_VIEWS = 2  # in which nothing else explains the silhouette where a bulge was
_NEEDED_SHARE = 0.05  # of a bulge's samples: then it was none,
# unless that is high and stands on so little of the face: feet of ribs (gusset .059), not fillets (stepped_shaft .122)
_STANDING_SHARE = 0.08
_TALL_CELLS = 10.0  # lower is a fillet (4 to 5 measured), or the plane cuts into the part (.5 measured)
_HALFWAY = 0.5  # of a bulge's height are its samples: of a strip of a cylinder .17 are needed there, .04 at its top
_STANDING_CELLS = 2  # around a sample that is needed
_LEAST_BULGE_CELLS = 0.5  # lower ones need no test
_ROUNDS = 2  # of looking again
_LARGER = 1.1  # than before, for a face to be cut again
_BLIND_CELLS = 3.0  # a bulge this high hid what lies beside it: views judge it, and the tighter hull is looked at again
_GAIN = 0.75  # of the views' disagreement is left at most without a bulge: .2-.5 measured, .9-3.2 where walls went too
_LEAST_RAYS = 100  # that tell, for them to judge
_SPOT_SHARE = 0.01  # of the largest part of a face: views are not asked about smaller ones (.005 measured)
_LEAST_FACING, _PARALLEL = 0.15, 0.985  # cosines between a face and another one that lies over a part of it
_MOVED_VOXELS = 0.5  # between a hull that has moved and the hull as it was,
_MOVED_SHARE = 0.2  # on this share of a face's samples: elsewhere nothing new is to be found
_REACH_VOXELS = 2.0  # rays on which a bulge changes less than this don't judge it

logger = get_logger("stage1")


def flatten_faces(
    images: Images,
    patches: NDArray[np.integer],
    hull: Volume,
    sampler: Sampler,
    known: Sequence[Face] | None = None,
    opened: bool = False,
    before: Scene | None = None,
) -> tuple[Volume, list[Face]]:
    """Find the planar faces and carve the hull down to them.

    A silhouette is blind to what lies above a plane that no camera grazes, and in inner corners; regions are not.

    Args:
        images: of all views.
        patches: (V, H, W) region ids of the masks, 0 = none.
        hull: what silhouettes leave.
        sampler: spreads points (N, 3) with normals (N, 3) evenly over a mesh.
        known: the faces that were found before, to look again in a hull that is tighter now: behind a high bulge are
            others. None = look for the first time.
        opened: whether the hull has been opened since then.
        before: the hull whose surface has moved since; faces are looked for where it has. None = everywhere.

    Returns:
        The carved hull and the faces, those that were found last first, best confirmed first among them.
    """
    faces = found = list(known or [])
    for _ in range(1 if known is None else _ROUNDS):
        if (
            known is not None
            and not opened
            and max((f.bulge for f in found), default=0.0) < _BLIND_CELLS * hull.spacing
        ):
            break
        opened = False
        hull, found = _flatten(images, patches, hull, sampler, faces, before)
        for face in found:
            logger.info(
                "planar face of area %.4f, normal %s: views disagree about %.2f %% of it, hull %.4f above",
                face.area, np.round(face.lattice.normal, 2).tolist(), 100 * face.disagreement, face.bulge,
            )  # fmt: skip
        faces = found + [f for f in faces if not any(_same(f, other, hull.spacing) for other in found)]
    return hull, faces


def _flatten(
    images: Images,
    patches: NDArray[np.integer],
    hull: Volume,
    sampler: Sampler,
    known: list[Face],
    before: Scene | None,
) -> tuple[Volume, list[Face]]:
    """The planar faces that a hull shows, beyond those that are known, and the hull cut down to them."""
    views = images.views
    mesh = hull.mesh()
    scene = Scene(*mesh)
    faces: list[Face] = []
    looked: list[tuple[Stack, Aligned]] = []  # at each
    for candidate in candidates(views.cameras, patches, scene, *sampler(*mesh)):
        if before is not None and not _moved(candidate.points, before, hull.spacing):
            continue
        stack = Stack(views.cameras, patches, candidate)
        aligned = align(stack, candidate, scene)
        if aligned is None:
            continue
        aligned = parallel(stack, candidate, scene, aligned, _directions([*known, *faces]))
        # what a cut has left of a rounded inner edge may be flat: only the hull as it was is worth a doubt
        face = confirm(images, stack, candidate, aligned, scene, strict=bool(known))
        if face is None or any(_same(face, other, hull.spacing) for other in faces):
            continue
        if not any(_same(face, other, hull.spacing) and face.area < _LARGER * other.area for other in known):
            faces.append(face)
            looked.append((stack, aligned))
    bare = [_bare(f, hull) for f in faces]
    found = zip(faces, looked, bare, strict=True)
    good = [(f, at, left) for f, at, left in found if _agreeable(images, f, hull, scene, left)]
    others = [*known, *(f for f, _, _ in good)]
    faces = [
        _without_spots(images, f, hull, scene, _apart(f, *at, hull.spacing, scene, left, others))
        for f, at, left in good
    ]
    carved = _carve(hull, faces)
    after = carved.scene()
    kept = [_allowed(views, f, mesh[0], hull.spacing, after) for f in faces]
    if any(old is not new for old, new in zip(faces, kept, strict=True)):
        faces = [f for f in kept if f is not None]
        carved = _carve(hull, faces)
    return clear_holes(carved, faces, partial(_needed, views), _NEEDED_SHARE), faces


def _directions(faces: Sequence[Face]) -> list[Array]:
    """Normals (3,) that other faces on a part are likely to have: of those of faces, the largest first, both signs."""
    ordered = sorted(faces, key=lambda f: -f.area)
    return [sign * f.lattice.normal for f in ordered for sign in (1.0, -1.0)]


def _moved(points: Array, before: Scene, spacing: float) -> bool:
    """Whether a good part of (N, 3) points on a hull lies off the hull as it was."""
    off = np.isinf(before.near(points, _MOVED_VOXELS * spacing))
    return bool(off.mean() >= _MOVED_SHARE)


def _same(face: Face, other: Face, spacing: float) -> bool:
    """Whether two faces lie on one plane and mostly on each other."""
    if face.lattice.normal @ other.lattice.normal < 0.99:
        return False
    within, heights = over(other.lattice, other.outline, face.lattice.centers()[face.outline])
    return bool((within & (np.abs(heights) < spacing)).mean() > 0.5)


def _without_spots(images: Images, face: Face, hull: Volume, scene: Scene, apart: NDArray[np.int64]) -> Face:
    """A face without the parts apart from most of it that a bulge stands on, unless the views tell that it does not.

    Inside of a hub's wall a plane is seen by few views, past the wall, and has whatever regions lie behind.

    Args:
        images: of all views.
        face: its outline.
        hull: with its bulge.
        scene: the same.
        apart: (R, C) kinds of cells that may be the foot of a rib, parts of their own; 0 = none.
    """
    parts = np.zeros(face.outline.shape, np.int64)
    for kind in np.unique(apart):
        found = ndimage.label(face.outline & (apart == kind), np.ones((3, 3)))[0]
        parts = np.where(found > 0, found + parts.max(), parts)
    sizes = np.bincount(parts.ravel())[1:]
    outline = face.outline.copy()
    for k in np.argsort(-sizes, kind="stable")[1:]:
        part = replace(face, outline=parts == k + 1)
        within, heights = over(part.lattice, part.outline, scene.vertices)
        part = replace(part, bulge=float(heights[within].max(initial=0.0)))
        if part.bulge < _BLIND_CELLS * hull.spacing:
            continue
        small = sizes[k] < _SPOT_SHARE * sizes.max()
        if small or not _told(images, hull, scene, _carve(hull, [part]).scene(), untold=False)[0]:
            outline &= ~part.outline
    return replace(face, outline=outline)


def _apart(
    face: Face,
    stack: Stack,
    aligned: Aligned,
    spacing: float,
    scene: Scene,
    bare: Scene | None,
    others: Sequence[Face],
) -> NDArray[np.int64]:
    """(R, C) which cells of a face may be the foot of a rib: 2 = below another face, 1 = else in doubt, 0 = none."""
    if bare is None:
        return np.zeros(face.outline.shape, np.int64)
    hidden = in_doubt(face, stack, aligned, scene, bare)
    return np.where(_below(face, others, spacing), 2, hidden.astype(np.int64))


def _below(face: Face, others: Sequence[Face], spacing: float) -> NDArray[np.bool_]:
    """(R, C) cells of a face over which others lie, within the height of its bulge."""
    below = np.zeros(face.outline.shape, bool)
    for other in others:
        facing = float(other.lattice.normal @ face.lattice.normal)
        if not _LEAST_FACING < facing < _PARALLEL:
            continue
        centers = other.lattice.centers()[other.outline]
        within, heights = over(face.lattice, face.outline, centers)
        within &= (heights > _BLIND_CELLS * spacing) & (heights < face.bulge + _SLACK_CELLS * spacing)
        wide = ndimage.binary_dilation(_cells_at(face, centers[within]), iterations=_STANDING_CELLS)
        below |= ndimage.binary_erosion(wide, iterations=_STANDING_CELLS, border_value=1)
    return below


def _cells_at(face: Face, points: Array) -> NDArray[np.bool_]:
    """(R, C) cells of a face's lattice that points (N, 3) lie over."""
    cells = np.round(face.lattice.coordinates(points)[0]).astype(int)
    found = np.zeros(face.outline.shape, bool)
    found[tuple(np.clip(cells, 0, np.array(found.shape) - 1).T)] = True
    return found


def _bare(face: Face, hull: Volume) -> Scene | None:
    """The surface of a hull without a face's bulge; None if that is too low to be judged."""
    return None if face.bulge < _BLIND_CELLS * hull.spacing else _carve(hull, [face]).scene()


def _agreeable(images: Images, face: Face, hull: Volume, scene: Scene, bare: Scene | None) -> bool:
    """Whether views agree better once a bulge is gone, as far as they tell: else it is none, or more went with it.

    The outline of a face that was seen through a bore, or with a wall beside it, takes walls away.
    """
    if bare is None:
        return True
    agreeable, (old, new, count) = _told(images, hull, scene, bare, untold=True)
    if not agreeable:
        logger.info(
            "bulge %.4f: views disagree by %.2f for %.2f of the hull, %d rays: kept", face.bulge, new, old, count
        )
    return agreeable


def _told(
    images: Images, hull: Volume, scene: Scene, bare: Scene, untold: bool
) -> tuple[bool, tuple[float, float, int]]:
    """Whether views agree better without a bulge (`untold` if they tell nothing), and what they say."""
    said = disagreements(images, scene, bare, _REACH_VOXELS * hull.spacing)
    return better(said, _GAIN, _LEAST_RAYS, untold), said


def _carve(hull: Volume, faces: list[Face]) -> Volume:
    """The hull without what stands above the faces, but for what goes on higher: the other side of a groove."""
    for face in faces:
        height = face.bulge + _SLACK_CELLS * hull.spacing
        outline = face.outline.copy()
        outline[face.outline] = ~standing(hull, face, face.outline, height)
        if outline.any():
            hull = hull.without(Prism(face.lattice, outline, 0.0, False, 0.0), height)
    return hull


def _allowed(views: Views, face: Face, vertices: Array, spacing: float, after: Scene) -> Face | None:
    """A face, without the feet of what silhouettes show to stand on it; None if that is most of what was cut off.

    A dome with a planar rim is no bulge. After: the hull without what stands above all faces.
    """
    within, heights = over(face.lattice, face.outline, vertices)
    within &= (heights > _LEAST_BULGE_CELLS * spacing) & (heights < face.bulge + _SLACK_CELLS * spacing)
    # halfway down: what lies on a contour is not surely object
    samples = vertices[within] - _HALFWAY * heights[within, None] * face.lattice.normal
    needed = _needed(views, samples, after)
    if not len(samples) or needed.mean() <= _NEEDED_SHARE:
        return face
    standing = ndimage.binary_dilation(_cells_at(face, samples[needed]), iterations=_STANDING_CELLS)
    few = (standing & face.outline).sum() <= _STANDING_SHARE * face.outline.sum()
    few &= float(np.median(heights[within][needed])) > _TALL_CELLS * spacing
    return replace(face, outline=face.outline & ~standing) if few else None


def _needed(views: Views, samples: Array, after: Scene) -> NDArray[np.bool_]:
    """(N,) whether silhouettes show samples (N, 3) that were cut off."""
    needed = np.zeros(len(samples), int)
    height_px, width_px = views.alpha.shape[1:]
    for view, center in enumerate(views.cameras.centers):
        pixels = np.floor(views.cameras.project(view, samples)[0]).astype(int)
        inside = (pixels >= 0).all(1) & (pixels[:, 0] < width_px) & (pixels[:, 1] < height_px)
        opaque = np.zeros(len(samples), bool)
        opaque[inside] = views.alpha[view, pixels[inside, 1], pixels[inside, 0]] >= OPAQUE
        ray = samples[opaque] - center
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        needed[opaque] += ~after.occluded(np.broadcast_to(center, ray.shape), ray)
    return np.asarray(needed >= _NEEDED_VIEWS)
