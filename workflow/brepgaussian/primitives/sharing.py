"""Labels that hold a face and a piece of its tangent neighbour: the border between the two is found anew.

No image shows the border between a fillet and the face that it touches, so a label may run over it; one surface for
both is then a torus or a cone that is neither, and the neighbour, which sees half of itself, has a wrong radius. A flat
or simpler part of the label and the neighbour together explain the points of both in fewer words.
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from brepgaussian.geometry.fit import ransac
from brepgaussian.geometry.fit_choose import EFFECTIVE, PRICE
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.log import get_logger
from brepgaussian.primitives.fitting import description, errors, fit_members
from brepgaussian.primitives.patches import Cloud, Indices, Noise, Patch, adjacent, thinned, without_strays
from brepgaussian.settings.primitives import PrimitivesSettings

log = get_logger("primitives")

REACH = 3.0  # noises from a simpler surface within which points of a label start it,
ALIGNED = np.radians(8.0)  # and their normals: a fillet leaves the face that it touches slowly
SAMPLES = 40  # of RANSAC
LEAST_SHARE, LEAST = 0.2, 40  # of a label's points that start a simpler surface, and points that any part keeps
ROUNDS = 4  # of giving the points to the nearest surface and fitting again
WORTH = 1.0  # parameters by which the description must get shorter


def share_out(patches: list[Patch], cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> list[Patch]:
    """Draw the borders between curved patches and their neighbours anew where both then are simpler or fit better."""
    patches = list(patches)
    for index in sorted(range(len(patches)), key=lambda k: (-len(patches[k].members), k)):
        touching = adjacent(patches, cloud)[index]
        best: tuple[float, int, Patch, Patch] | None = None
        for start in _simpler(patches[index], cloud, noise, settings):
            for other in np.flatnonzero(touching).tolist():
                if patches[other].surface.kind == "plane":
                    continue
                found = _shared(patches[index], patches[other], start, cloud, noise, settings)
                if found is not None and (best is None or found[0] > best[0]):
                    best = found[0], other, *found[1:]
        if best is not None:
            _, other, rest, more = best
            kinds = patches[index].surface.kind, rest.surface.kind, more.surface.kind
            log.info("labels %s: a %s is a %s and a piece of the %s beside it", list(rest.labels), *kinds)
            patches[index], patches[other] = rest, more
    return patches


def _simpler(patch: Patch, cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> Iterator[Surface]:
    """Simpler surfaces that explain a part of a patch."""
    some = thinned(patch.members, settings.sample)
    for kind in ("plane", "cylinder"):
        if kind not in settings.kinds or PRICE[kind] >= PRICE[patch.surface.kind]:
            continue
        xyz, normals = cloud.xyz[some], cloud.normals[some]
        rng = np.random.default_rng(settings.seed)
        surface, near = ransac(xyz, normals, (kind,), REACH * noise.distance, ALIGNED, rng, SAMPLES)
        if surface is not None and near.sum() >= LEAST_SHARE * len(some):
            yield surface


def _shared(
    patch: Patch, other: Patch, start: Surface, cloud: Cloud, noise: Noise, settings: PrimitivesSettings
) -> tuple[float, Patch, Patch] | None:
    """How much shorter two patches are described with a new border, and what they become."""
    members = np.union1d(patch.members, other.members)
    pair = [replace(patch, surface=start), other]
    for _ in range(ROUNDS):
        owner = errors(pair, members, cloud, noise)[2]
        fitted = [_fitted(p, members[owner == k], cloud, noise, settings) for k, p in enumerate(pair)]
        if fitted[0] is None or fitted[1] is None:
            return None
        pair = [p for p in fitted if p is not None]
    gain = description([patch, other], members, cloud, noise) - description(pair, members, cloud, noise)
    return (gain, pair[0], pair[1]) if gain >= WORTH * np.log(EFFECTIVE) else None


def _fitted(patch: Patch, members: Indices, cloud: Cloud, noise: Noise, settings: PrimitivesSettings) -> Patch | None:
    """A patch with other points, its surface of the same kind."""
    if len(members) < LEAST:
        return None
    same = replace(settings, kinds=(patch.surface.kind,))
    return fit_members(
        patch.labels, np.concatenate(without_strays(cloud, members)), cloud, noise, same, (patch.surface,)
    )
