"""A hull opened step by step: down to its faces, rooms and channels, notches and corners, what has lids, what is left.

The order is what was measured to work: each step makes the surface truer by which the next one is told.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from brepgaussian import log
from brepgaussian.splatting.concave import (
    Bend,
    Images,
    Plane,
    Prism,
    open_alike,
    open_channels,
    open_concavities,
    open_corners,
    open_curved,
    open_feet,
    open_grooves,
    open_levels,
    open_notches,
    open_onward,
    open_recesses,
    preferred,
    refilled,
    widen,
    without_fins,
    without_skins,
)
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.evidence import edge_cloud
from brepgaussian.splatting.faces import Face, Fillet, flatten_faces, round_edges
from brepgaussian.splatting.faces.flatten import Sampler
from brepgaussian.splatting.relief import relieve

_REACH_VOXELS = 2.0  # rays on which two hulls differ by less don't tell which is better

logger = log.get_logger("stage1")


@dataclass(frozen=True)
class Shown:
    """What shows where a hull is open.

    Attributes:
        images: of all views.
        patches: (V, H, W) region ids of the masks, 0 = none; None = no faces are looked for.
        sampler: spreads points (N, 3) with normals (N, 3) evenly over a mesh.
        noise: standard deviation of the images' noise, grey levels.
    """

    images: Images
    patches: NDArray[np.integer] | None
    sampler: Sampler
    noise: float = 0.0


@dataclass(frozen=True)
class Opened:
    """A hull as far as it is open, the planar faces that were confirmed, and what was opened."""

    volume: Volume
    faces: Sequence[Face] = ()
    prisms: Sequence[Prism] = ()
    fillets: Sequence[Fillet] = ()
    bends: Sequence[Bend] = ()

    @property
    def planes(self) -> list[Plane]:
        """On which faces lie."""
        return [Plane(f.lattice.normal, f.lattice.offset) for f in self.faces]

    @property
    def outlines(self) -> list[tuple[Lattice, NDArray[np.bool_]]]:
        """Of faces: cells (R, C) of their lattices."""
        return [(f.lattice, f.outline) for f in self.faces]


def opened(shown: Shown, hull: Volume, concavities: bool, relief: bool) -> Opened:
    """What silhouettes leave, opened as far as images show it to be; arguments are those of `hull.carve`."""
    found = Opened(hull)
    if shown.patches is not None:
        found = Opened(*flatten_faces(shown.images, shown.patches, hull, shown.sampler))
    if concavities:
        found = _concavities(shown, _begun(shown, hull, found))
    elif shown.patches is not None:
        found = _faces_again(shown, hull, found, False)
    if shown.patches is not None and relief:
        found = _moved(shown, found, concavities)
    return found


@dataclass(frozen=True)
class _Begun:
    """A hull whose corners are open: before anything was, before corners were, and now."""

    flat: Volume
    uncut: Volume
    now: Opened


def _begun(shown: Shown, silhouettes: Volume, flat: Opened) -> _Begun:
    """What is open at its sides, with or without rooms over floors to begin with: as views like it better.

    A room seldom reaches into the corners of its walls, and what is left there has no lid that tells of a corner. But
    where floors are none of what is beside them, corners are sought in vain.
    """
    rooms = open_levels(shown.images, flat.volume, flat.planes)
    found = _sides(shown, silhouettes, flat, flat.volume)
    if rooms is flat.volume:
        return found
    other = _sides(shown, silhouettes, flat, rooms)
    corners, levels = found.now.volume, other.now.volume
    better = preferred(shown.images, corners.scene(), levels.scene(), _REACH_VOXELS * corners.spacing)
    logger.info("rooms over floors %s", "kept" if better else "left to corners")
    return other if better else found


def _sides(shown: Shown, silhouettes: Volume, flat: Opened, hull: Volume) -> _Begun:
    """Channels, notches, feet of bosses and corners of a hull that is flat, and may have rooms cut."""
    images = shown.images
    volume, prisms = open_channels(images, hull, flat.outlines)
    found = replace(flat, volume=volume, prisms=prisms)
    if shown.patches is not None:
        found = _faces_again(shown, silhouettes, found, bool(prisms) or volume is not flat.volume)
    volume, notches = open_notches(images, found.volume, found.planes)
    uncut = open_feet(images, volume, found.outlines)
    volume = open_corners(images, uncut, found.planes)
    return _Begun(flat.volume, uncut, replace(found, volume=volume, prisms=[*prisms, *notches]))


def _faces_again(shown: Shown, silhouettes: Volume, found: Opened, changed: bool) -> Opened:
    """Faces of a hull that may have `changed` since they were found, and the fillets between them."""
    images, patches = shown.images, shown.patches
    assert patches is not None
    volume, faces = flatten_faces(images, patches, found.volume, shown.sampler, found.faces, changed)
    volume, faces, fillets = round_edges(images, silhouettes, volume, faces)
    return replace(found, volume=volume, faces=faces, fillets=fillets)


def _concavities(shown: Shown, begun: _Begun) -> Opened:
    """What has lids, and all that is told once that is open."""
    images, now = shown.images, begun.now
    planes, outlines = now.planes, now.outlines
    volume, more, bends = open_concavities(images, now.volume, planes, begun.flat)
    volume, more = open_onward(images, volume, more)  # an end that it has not passes for a recess
    volume, recesses = open_recesses(images, volume, outlines, more)
    # last: what rays tell goes before what is likely
    volume, wider = widen(images, volume, planes, more)
    prisms = [*now.prisms, *more, *recesses, *wider]
    volume = refilled(images, begun.uncut, now.volume, volume, prisms)
    volume = open_levels(images, open_alike(images, volume, planes), planes)
    volume = without_fins(images, volume)
    volume, prisms = open_onward(images, volume, prisms)
    volume = _bared(shown, open_grooves(images, volume, prisms), planes)
    return replace(now, volume=volume, prisms=prisms, bends=bends)


def _bared(shown: Shown, volume: Volume, planes: Sequence[Plane]) -> Volume:
    """A hull without skins over planes that the 3D edges of the images tell."""
    if not planes:
        return volume
    cloud = edge_cloud(shown.images.views, volume.scene(), shown.noise)
    return without_skins(shown.images, volume, cloud, planes)


def _moved(shown: Shown, found: Opened, concavities: bool) -> Opened:
    """The surface moved to where parallax shows it, with the faces that are seen only then."""
    images, patches = shown.images, shown.patches
    assert patches is not None
    volume = relieve(images, patches, list(found.faces), found.volume)
    if volume is found.volume:
        return found
    before = found.volume.scene()
    volume, faces = flatten_faces(images, patches, volume, shown.sampler, found.faces, True, before)
    found = replace(found, volume=volume, faces=faces)
    if concavities:  # what curved faces hold shows where these are right, as below a flange
        curved = open_curved(images, volume, found.prisms, found.planes)
        volume, prisms = open_onward(images, *curved)
        found = replace(found, volume=volume, prisms=prisms)
    return found
