"""Grooves around the wall of a bore, such as those of retaining and sealing rings.

No silhouette shows them, and views into a bore see them at a slant. Floor and sides have about one grey, so that views
agree about most of the wall with which a hull closes a groove; but not beside its rims, past which some views see the
floor and others a side. Two rings of such places around a bore are a groove's rims. How deep it is the rays tell.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from brepgaussian import log
from brepgaussian.splatting.concave.agreement import Rays, mean_cost, rays_near
from brepgaussian.splatting.concave.contours import chords_in, lost_share
from brepgaussian.splatting.concave.ends import is_straight
from brepgaussian.splatting.concave.join import throat
from brepgaussian.splatting.concave.openings import REFUTED_SHARE, Images, refuted_share
from brepgaussian.splatting.concave.planes import PITCH_PIXELS
from brepgaussian.splatting.concave.prism import Prism, plane_axes
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.shapes import SURE, Costs
from brepgaussian.splatting.concave.shoulders import is_round
from brepgaussian.splatting.concave.turned import Axis
from brepgaussian.splatting.concave.volume import Volume

Array = NDArray[np.float64]

_ANGLES = 48  # about a bore, at which its wall is looked at
# Of the wall at a rim is refuted; .1 to .3 is so of any wall, seen at a slant, .4 to .9 of true ones.
_ALL_AROUND, _STANDS_OUT = 0.35, 2.0  # that share at least, and times the usual one
_BLUR_CELLS = 0.7  # of that share along the bore
_MOST_RIMS = 4  # of a bore, those that stand out most
_CLEAR_CELLS = 4.0  # of a bore's ends: there views differ anyhow
_NARROWEST_CELLS = 5.0  # a groove narrower than that is not told from blur
_WIDEST = 1.5  # radii of the bore; wider than that is a chamber
_DEEPEST = 0.5  # radii of the bore
_DEPTHS, _FINER = 5, 9  # that are tried at first, and about the best of them
_LEAST_VOXELS = 1.5  # depth of a groove
_ON_WALL_VOXELS = 2.0  # from the hull's surface: elsewhere the bore has no wall
_SAME = 0.9998  # cosine of the angle between axes of one bore
_LEAST_RAYS = 200  # that tell
# Of the rays' disagreement that is left at most: .55 to .77 measured, for most rays tell of no groove.
_GAIN = 0.85
_AS_WELL = 1.0  # standard errors: depths that rays like alike, near the best one
_SHIFTS = np.arange(-3, 4)  # cells by which a rim may lie beside where views differ most
_MOST_LOST = 0.01  # of the contours' rays through a groove that it may leave with nothing
_REACH_VOXELS = 4.0  # around a groove in which the field follows it

logger = log.get_logger("stage1")


@dataclass(frozen=True, eq=False)
class Groove:
    """A ring around a bore.

    Attributes:
        middle: (3,) of the bore's mouth; down: (3,) unit direction of its axis, into the solid.
        radius: of the bore; depth: of the groove's floor below the bore's wall.
        top, bottom: how far its rims lie down the bore.
    """

    middle: Array
    down: Array
    radius: float
    top: float
    bottom: float
    depth: float = 0.0

    def wall(self, heights: Array, depth: float = 0.0) -> tuple[Array, Array]:
        """(A, H, 3) places on the bore's wall at heights (H,) down it, or below it, (A, H, 3) normals out of it."""
        angle = 2 * np.pi * np.arange(_ANGLES) / _ANGLES
        first, second = plane_axes(self.down)
        out = np.cos(angle)[:, None] * first + np.sin(angle)[:, None] * second
        places = self.middle + (self.radius + depth) * out[:, None] + heights[None, :, None] * self.down
        return places, np.broadcast_to(-out[:, None], places.shape)

    @property
    def ends(self) -> Array:
        """(N, 3) places between which it lies."""
        return self.wall(np.array([self.top, self.bottom]), self.depth)[0].reshape(-1, 3)

    def signed_distance(self, points: Array, within: float) -> Array:
        """(N,) distances of points (N, 3) from the groove, which reaches into the bore by `within`; negative inside."""
        radii = self.radius - within, self.radius + self.depth
        return self.axis.ring_distance(points, radii, (self.top, self.bottom))

    def is_at_wall(self, points: Array, slack: float) -> NDArray[np.bool_]:
        """(N,) whether points (N, 3) are on the wall that closes it."""
        radius, height = self.axis.cylindrical(points)
        return np.asarray((np.abs(radius - self.radius) < slack) & (height > self.top) & (height < self.bottom))

    @property
    def axis(self) -> Axis:
        """Of the bore, heights from its mouth."""
        return Axis(self.middle, self.down)


def open_grooves(images: Images, hull: Volume, known: Sequence[Prism]) -> Volume:
    """Carve the grooves in the walls of round bores.

    Args:
        images: of all views.
        hull: with all that is known cut.
        known: concavities of it.
    """
    pitch = PITCH_PIXELS * images.views.cameras.footprint()
    bores = _bores(known, 2 * hull.spacing)
    scene = hull.scene(known) if bores else None
    for bore in bores:
        assert scene is not None
        spans = _spans(_rims(images, scene, bore, pitch, hull.spacing), bore, pitch)
        while spans:
            groove = _best(images, hull, scene, spans, pitch)
            if groove is None:
                break
            hull = _without(hull, groove)
            spans = [s for s in spans if s.bottom <= groove.top or s.top >= groove.bottom]
            scene = hull.scene(known)
    return hull


def _bores(known: Sequence[Prism], tolerance: float) -> list[Groove]:
    """Round straight holes, each once though it may be known from either end, as grooves from end to end."""
    found: list[Groove] = []
    for prism in known:
        if not is_straight(prism) or not is_round(prism.outline) or prism.islands:
            continue
        bore = Groove(prism.middle, -prism.lattice.normal, throat(prism), 0.0, prism.depth)
        if not any(_is_one(bore, other, tolerance) for other in found):
            found.append(bore)
    return found


def _is_one(bore: Groove, other: Groove, tolerance: float) -> bool:
    """Whether two bores have one axis and one width, and one is in the other."""
    radius, height = other.axis.cylindrical(bore.wall(np.array([bore.bottom / 2]))[0].reshape(-1, 3))
    alike = abs(float(bore.down @ other.down)) > _SAME and np.abs(radius - other.radius).max() < tolerance
    return bool(alike and (height > 0).all() and (height < other.bottom).all())


def _rims(images: Images, scene: Scene, bore: Groove, pitch: float, cell: float) -> list[float]:
    """How far down a bore views disagree all around its wall, clear of its ends."""
    heights = np.arange(_CLEAR_CELLS * pitch, bore.bottom - _CLEAR_CELLS * pitch, pitch)
    if len(heights) < _NARROWEST_CELLS:
        return []
    places, normals = (part.reshape(-1, 3) for part in bore.wall(heights))
    shape = _ANGLES, len(heights)
    on = (np.abs(scene.near(places, _ON_WALL_VOXELS * cell)) < _ON_WALL_VOXELS * cell).reshape(shape)
    refuted = refuted_share(images, scene, places, normals, pitch).reshape(shape) > REFUTED_SHARE
    around = ndimage.gaussian_filter1d((refuted & on).sum(axis=0) / np.maximum(on.sum(axis=0), 1), _BLUR_CELLS)
    labels, count = ndimage.label(around >= max(_ALL_AROUND, _STANDS_OUT * float(np.median(around))))
    pieces = [np.flatnonzero(labels == k + 1) for k in range(count)]
    pieces = sorted(pieces, key=lambda cells: -float(around[cells].max()))[:_MOST_RIMS]
    return sorted(float(np.average(heights[cells], weights=around[cells])) for cells in pieces)


def _spans(rims: Sequence[float], bore: Groove, pitch: float) -> list[Groove]:
    """The bore's wall between any two rims that a groove may lie between."""
    pairs = combinations(rims, 2)
    return [
        replace(bore, top=top, bottom=bottom)
        for top, bottom in pairs
        if _NARROWEST_CELLS * pitch < bottom - top < _WIDEST * bore.radius
    ]


def _best(images: Images, hull: Volume, scene: Scene, spans: Sequence[Groove], pitch: float) -> Groove | None:
    """The groove between two rims about which rays agree best, as deep as they tell; None if they don't much better."""
    wall = replace(spans[0], top=min(s.top for s in spans), bottom=max(s.bottom for s in spans))
    near = rays_near(images, wall.ends)
    rays = near.hitting(scene, lambda points: wall.is_at_wall(points, _ON_WALL_VOXELS * hull.spacing))
    asked = _Asked(rays, rays.costs(scene), hull)
    if np.count_nonzero(asked.before[1]) < _LEAST_RAYS:
        return None
    depths = np.geomspace(_LEAST_VOXELS * hull.spacing, _DEEPEST * wall.radius, _DEPTHS)
    span = max(spans, key=lambda s: max(asked.gain(replace(s, depth=float(depth))) for depth in depths))
    groove = asked.least_deep(span, depths, SURE)
    if not _believed(images, scene, groove, asked):
        return None
    shallower = depths[max(int(np.searchsorted(depths, groove.depth)) - 1, 0)]
    for rim in ("top", "bottom"):
        shifted = [replace(groove, **{rim: getattr(groove, rim) + float(k) * pitch}) for k in _SHIFTS]
        groove = max(shifted, key=asked.gain)
    return asked.least_deep(groove, np.linspace(shallower, groove.depth, _FINER), _AS_WELL)


@dataclass(frozen=True)
class _Asked:
    """Rays that hit a bore's wall, and what they say of the hull before and after a groove is cut into it."""

    rays: Rays
    before: Costs
    hull: Volume
    _known: dict[tuple[float, float, float], Costs] = field(default_factory=dict)

    def after(self, groove: Groove) -> Costs:
        """Differences of the rays on the hull without a groove; see `Rays.costs`."""
        key = groove.top, groove.bottom, groove.depth
        if key not in self._known:
            self._known[key] = self.rays.costs(_without(self.hull, groove).scene())
        return self._known[key]

    def gain(self, groove: Groove) -> float:
        """By how much less the rays disagree in all, those that tell both times."""
        after = self.after(groove)
        return float((self.before[0] - after[0])[self.before[1] & after[1]].sum())

    def least_deep(self, span: Groove, depths: Array, sure: float) -> Groove:
        """The least deep groove that rays like as well as any, to some standard errors.

        As floor and sides have one grey, no more rays contradict a deeper one.
        """
        grooves = [replace(span, depth=float(depth)) for depth in depths]
        most = self.after(max(grooves, key=self.gain))
        return next(g for g in grooves if self.rays.advantage(self.after(g), most) <= sure)


def _believed(images: Images, scene: Scene, groove: Groove, asked: _Asked) -> bool:
    """Whether rays agree much better on a groove, and silhouettes don't need what was there."""
    before, after = asked.before, asked.after(groove)
    both = before[1] & after[1]
    old, new = (mean_cost((costs[0], both)) for costs in (before, after))
    sure = asked.rays.advantage(before, after)
    chords = chords_in(scene, *images.contour_rays)
    lost = lost_share(chords, groove.signed_distance(chords.samples(), 0.0) < 0)
    good = bool(both.sum() >= _LEAST_RAYS and new <= _GAIN * old and sure > SURE and lost <= _MOST_LOST)
    logger.info(
        "groove in a bore of radius %.4f, %.4f to %.4f down it, %.4f deep: views disagree by %.2f for %.2f of the "
        "wall, %d rays, %.1f sigma%s",
        groove.radius, groove.top, groove.bottom, groove.depth, new, old, both.sum(), sure,
        "" if good else ": not believed",
    )  # fmt: skip
    return good


def _without(hull: Volume, groove: Groove) -> Volume:
    """The hull without a groove."""
    reach = _REACH_VOXELS * hull.spacing

    def outside(points: Array) -> Array:
        return groove.signed_distance(points, _ON_WALL_VOXELS * hull.spacing)

    return hull.carved(groove.ends, reach, outside)
