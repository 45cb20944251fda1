"""Channels and slots that are open at their ends, made straight.

Silhouettes along a channel show its section; with perspective they show it at the ends only, and towards the
middle a hull closes it. So a column along the direction of a face's normal that the hull leaves empty anywhere
between two faces is taken to be empty all along, if the silhouettes stay filled and the views agree better.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import better, disagreements
from brepgaussian.splatting.concave.contours import Chords, chords_in, lost_rays, lost_share
from brepgaussian.splatting.concave.openings import Images
from brepgaussian.splatting.concave.planes import Plane, planar_regions
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]
Field = NDArray[np.float32]

_PARALLEL = 0.998  # cosine of 3.6 degrees
LEAST_AREA = 0.01  # of a face that ends a channel
_END_VOXELS = 3.0  # at a channel's ends the hull is rounded
_RIM_VOXELS = 1.0  # the same at an end that shows the section: past it the hull rises as steeply as cameras look down
_BESIDE_VOXELS = 3  # so far from what is surely empty a section is as wide as its rim shows it
_AT_END_VOXELS = 2  # there a channel shows its section; what crosses it in the middle is none of it
_LEAST_CELLS = 12  # of a section's region that changes
_FINER = 2  # cells of a section for each voxel
_LEAST_VOLUME_VOXELS = 300  # less is left to the surfels
_LEAST_PART_VOXELS = 60  # of one of several channels
MOST_LOST = 0.01  # share of the rays through a cut that it may leave with nothing
_DEEP = 0.5  # share of what silhouettes miss that lies deep in a section, not at its brim: the section is wrong
_GAIN = 0.8  # a cut leaves at most this share of the disagreement
_LEAST_RAYS = 200
_LEAST_RAYS_AT_ENDS = 60  # that both ends are open speaks for a channel, too
_MOST_CUTS = 4  # channels of one part
_MOST_CHECKED = 12  # hypotheses of one direction, largest first
_MOST_TRIED = 6  # of all directions, for the next cut, largest first

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class Cut:
    """Columns to empty.

    Attributes:
        prisms: of one direction; their outlines are lateral, without margins.
        volume: in voxels.
        at_ends: whether both ends of each column are empty; else it is empty somewhere.
        in_hole: whether it widens a hole that goes through from face to face.
    """

    prisms: tuple[Prism, ...]
    volume: float
    at_ends: bool
    in_hole: bool = False


def straighten(images: Images, hull: Volume) -> tuple[Volume, list[Prism]]:
    """Empty the columns that are empty at their ends.

    Args:
        images: of all views.
        hull: what silhouettes leave.

    Returns:
        The hull and what was cut.
    """
    done: list[Prism] = []
    for _ in range(_MOST_CUTS):
        mesh = hull.mesh()
        scene = Scene(*mesh)
        chords = chords_in(scene, *images.contour_rays)
        samples = chords.samples()
        regions = [r for r in planar_regions(*mesh, 2 * hull.spacing) if r.area(*mesh) >= LEAST_AREA]
        every = [c for normal in directions(regions) for c in _possible(chords, samples, cuts(hull, normal, regions))]
        # the right direction explains all of a channel at once, others parts of it
        for cut in sorted(every, key=lambda c: -c.volume)[:_MOST_TRIED]:
            opened, good = _judged(images, hull, cut)
            if good:
                less = None if cut.at_ends else _shown_at_ends(images, hull, cut, opened, every)
                hull, prisms = less or (opened, cut.prisms)
                done += prisms
                break
        else:
            break
    return hull, done


def _judged(images: Images, hull: Volume, cut: Cut) -> tuple[Volume, bool]:
    """A hull without a cut, and whether views agree about it better."""
    opened = _without(hull, cut.prisms)
    old, new, count = said = disagreements(images, hull.scene(), opened.scene(), 2 * hull.spacing)
    good = better(said, _GAIN, _LEAST_RAYS_AT_ENDS if cut.at_ends else _LEAST_RAYS, untold=False)
    logger.info(
        "%s along %s, %.0f voxels: views disagree by %.2f for %.2f of the hull, %d rays%s",
        "channel" if len(cut.prisms) == 1 else f"{len(cut.prisms)} channels",
        np.round(cut.prisms[0].lattice.normal, 2).tolist(), cut.volume, new, old, count,
        "" if good else ": not believed",
    )  # fmt: skip
    return opened, good


def _without(hull: Volume, prisms: Sequence[Prism]) -> Volume:
    for prism in prisms:
        hull = hull.without(prism, 0.0)
    return hull


def _shown_at_ends(
    images: Images, hull: Volume, cut: Cut, opened: Volume, every: Sequence[Cut]
) -> tuple[Volume, tuple[Prism, ...]] | None:
    """What is open at both ends of columns that are empty somewhere, where nothing tells of the rest of them.

    A bore across a channel's floor is a slit along all of it, and views that see the floor speak for both.
    """
    (prism,) = cut.prisms
    parts = [
        other
        for other in every
        if other.at_ends and len(other.prisms) == 1 and _share(other.prisms[0], prism) and other.volume < cut.volume
    ]
    if not parts:
        return None
    ends = tuple(part.prisms[0] for part in parts)
    less = _without(hull, ends)
    rest = disagreements(images, less.scene(), opened.scene(), 2 * hull.spacing)
    if better(rest, _GAIN, _LEAST_RAYS, untold=False):
        return None
    together = Cut(ends, sum(part.volume for part in parts), True)
    return (less, ends) if _judged(images, hull, together)[1] else None


def _share(one: Prism, other: Prism) -> bool:
    """Whether two columns of one direction have cells and a stretch in common."""
    same = one.outline.shape == other.outline.shape and np.allclose(one.lattice.normal, other.lattice.normal)
    if not same or not (one.outline & other.outline).any():
        return False
    top, end = (float(p.lattice.origin @ p.lattice.normal) for p in (one, other))
    return min(top, end) > max(top - one.depth, end - other.depth)


def directions(faces: Sequence[Plane]) -> list[Array]:
    """Normals of faces with another face at their back, each direction once.

    Faces that look at each other, as those of a bore that silhouettes leave angular, end no channel.
    """
    found: list[Array] = []
    for face in faces:
        behind = any(face.normal @ o.normal < -_PARALLEL and face.offset > -o.offset for o in faces)
        if behind and not any(abs(face.normal @ other) > _PARALLEL for other in found):
            found.append(face.normal)
    return found


def _possible(chords: Chords, samples: Array, cuts: list[Cut]) -> list[Cut]:
    """Those cuts that leave the silhouettes filled; all that are open at both ends at once as well."""
    largest = sorted(cuts, key=lambda c: -c.volume)[:_MOST_CHECKED]
    kept = [c for cut in largest if (c := _filling(chords, samples, cut)) is not None]
    ends = [c for c in kept if c.at_ends]
    if len(ends) > 1:
        kept.append(Cut(tuple(c.prisms[0] for c in ends), sum(c.volume for c in ends), True))
    return [c for c in kept if c.volume >= _LEAST_VOLUME_VOXELS]


def _filling(chords: Chords, samples: Array, cut: Cut) -> Cut | None:
    """A cut that leaves the silhouettes filled, without the brim of its section if that is what they need.

    At a channel's ends the hull is rounded, and a brim as wide as its rim would be cut all along.
    """
    prism = cut.prisms[0]
    removed = prism.contains(samples, 0.0)
    if lost_share(chords, removed) <= MOST_LOST:
        return cut
    lost = samples.reshape(len(chords.ray), -1, 3)[lost_rays(chords, removed)[chords.ray]].reshape(-1, 3)
    cells, _ = prism.lattice.coordinates(lost)
    deep = prism.lateral(cells) < -_BESIDE_VOXELS * _FINER * prism.lattice.pitch
    if deep.any() and deep.mean() > _DEEP:
        return None
    brim = np.zeros_like(prism.outline)
    brim[tuple(np.clip(np.round(cells[~deep]).astype(int), 0, np.array(brim.shape) - 1).T)] = True
    less = replace(prism, outline=prism.outline & ~ndimage.binary_dilation(brim, iterations=_FINER))
    if not less.outline.any() or lost_share(chords, less.contains(samples, 0.0)) > MOST_LOST:
        return None
    return replace(cut, prisms=(less,))


def cuts(hull: Volume, normal: Array, faces: Sequence[Plane]) -> list[Cut]:
    """Columns that are empty somewhere between two neighbouring faces across a direction, and full elsewhere."""
    field, origin, spacing = hull.field, hull.origin, hull.spacing
    first, second = plane_axes(normal)
    corners = origin + spacing * (np.array(np.meshgrid(*[[0, n - 1] for n in field.shape])).reshape(3, -1).T)
    corners = corners @ np.stack([first, second, normal]).T
    low, high = corners.min(axis=0), corners.max(axis=0)
    u, v, w = (np.arange(low[k], high[k], spacing) for k in range(3))
    base = u[:, None, None] * first + v[None, :, None] * second
    columns = np.empty((len(w), len(u), len(v)), np.float32)
    for k, height in enumerate(w):
        index = ((base + height * normal - origin) / spacing).reshape(-1, 3).T
        columns[k] = ndimage.map_coordinates(field, index, order=1, cval=-spacing).reshape(len(u), len(v))
    found = []
    for bottom, top, crossed in _spans(normal, faces, spacing):
        inner = columns[(w > bottom + _END_VOXELS * spacing) & (w < top - _END_VOXELS * spacing)]
        if not len(inner):
            continue
        start = (u[0] - spacing / 2) * first + (v[0] - spacing / 2) * second + top * normal
        lattice = Lattice(start, first, second, normal, spacing / _FINER, (_FINER * len(u), _FINER * len(v)))
        outer = columns[(w > bottom + _RIM_VOXELS * spacing) & (w < top - _RIM_VOXELS * spacing)]
        anywhere = inner.min(axis=0)
        sections = [(_at_ends(inner), _at_ends(outer), True)]
        if not crossed:
            sections.insert(0, (anywhere, anywhere, False))
        for least, widest, open_ended in sections:
            for outline, volume, in_hole in _sections(least, widest, inner, spacing):
                prism = Prism(lattice, outline, top - bottom, False, 0.0)
                found.append(Cut((prism,), volume, open_ended, in_hole and not crossed))
    return found


def _at_ends(columns: Field) -> Field:
    """(R, C) negative where columns (K, R, C) are empty at both ends."""
    return np.maximum(columns[:_AT_END_VOXELS].min(axis=0), columns[-_AT_END_VOXELS:].min(axis=0))


def _sections(
    least: Field, widest: Field, columns: Field, spacing: float
) -> list[tuple[NDArray[np.bool_], float, bool]]:
    """Outlines (finer by `_FINER`) of regions of columns (K, R, C) that are full somewhere, volumes in voxels, and
    whether each is beside a hole.

    Args:
        least: (R, C) negative where a column counts as empty; widest: the same, for those beside such a region.
    """
    volume = (columns > 0).sum(axis=0)
    most = columns.max(axis=0)
    hole = ndimage.binary_fill_holes(most > 0) & (most <= 0)
    labels, count = ndimage.label((least < 0) & (most > 0))
    found = []
    for k in range(1, count + 1):
        member = labels == k
        if member.sum() < _LEAST_CELLS or volume[member].sum() < _LEAST_PART_VOXELS:
            continue
        beside = ndimage.binary_dilation(member, iterations=_BESIDE_VOXELS)
        section = member | beside & (widest < 0) & ((most <= 0) | (labels == 0))
        fine = ndimage.zoom(np.where(section | (widest >= 0), widest, spacing), _FINER, order=1, grid_mode=True,
                            mode="nearest")  # fmt: skip
        near = ndimage.binary_dilation(np.kron(section, np.ones((_FINER, _FINER), bool)), iterations=_FINER)
        outline = (fine < 0) & near
        if outline.any():
            in_hole = bool((hole & ndimage.binary_dilation(member)).any())
            found.append((outline, float(volume[member].sum()), in_hole))
    return found


def _spans(normal: Array, faces: Sequence[Plane], spacing: float) -> list[tuple[float, float, bool]]:
    """Where channels along a direction may begin and end, and whether other faces lie between.

    A slot across a channel has two faces that end it there; past it the channel goes on, to a face that looks the
    other way than the first.
    """
    steps = _steps(normal, faces, spacing)
    spans = [(bottom, top, False) for bottom, top in pairwise(steps)]
    down, up = (_steps(normal, [f for f in faces if side * (f.normal @ normal) > 0], spacing) for side in (-1, 1))

    def near(height: float, ends: list[float]) -> bool:
        return any(abs(height - end) <= 2 * _END_VOXELS * spacing for end in ends)

    def between(ends: list[float], bottom: float, top: float) -> bool:
        return any(bottom < end < top and not near(end, [bottom, top]) for end in ends)

    long = [(steps[i], steps[j]) for i, j in combinations(range(len(steps)), 2) if j - i > 1]
    return spans + [
        (bottom, top, True)
        for bottom, top in long
        if near(bottom, down) and near(top, up) and between(down, bottom, top) and between(up, bottom, top)
    ]


def _steps(normal: Array, faces: Sequence[Plane], spacing: float) -> list[float]:
    """Heights of the faces across a direction, ascending."""
    heights = sorted(float(np.sign(f.normal @ normal) * f.offset) for f in faces if abs(f.normal @ normal) > _PARALLEL)
    kept: list[float] = []
    for height in heights:
        if not kept or height - kept[-1] > 2 * _END_VOXELS * spacing:
            kept.append(height)
    return kept
