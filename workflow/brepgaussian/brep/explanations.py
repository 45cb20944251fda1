"""Other explanations of the same patches: rolled fillets, straight walls, one face for two, faces without points."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from brepgaussian.brep.blends import blended, spare
from brepgaussian.brep.coplanar import coplanar
from brepgaussian.brep.crowns import crowned
from brepgaussian.brep.fillets import rounded
from brepgaussian.brep.flats import ends_of_flats
from brepgaussian.brep.job import Job
from brepgaussian.brep.low_walls import low_walls
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.profiles import flattened, grooved, straightened, unbent
from brepgaussian.brep.sections import angular
from brepgaussian.brep.simplify import Change, applied
from brepgaussian.brep.skins import ramps, skins
from brepgaussian.brep.symmetry import symmetric
from brepgaussian.brep.tangents import cleared, tangent_walls
from brepgaussian.brep.tubes import bent_tubes, even_tubes
from brepgaussian.log import get_logger


def explanations(job: Job, sigma: float) -> Iterator[Job]:
    """The job with bends tangent to pipes, shoulders where flats on shafts end, rolled fillets, fillets all around flat
    faces, low round walls, flat cones and short arcs as planes, coplanar faces, even pipes, without skins, smooth
    fillets, planes for curved walls, what symmetries carry, straight profiles, grooves, planes clear of what they
    touch.
    """
    yield from _changed(job, bent_tubes(job.patches, sigma))
    ends = ends_of_flats(job.patches)
    if ends:
        yield replace(job, floors=(*job.floors, *ends))
    yield from rolled(job, sigma)
    for around in _with_changes(job, crowned(job.patches, sigma)):
        yield from rolled(around, sigma)
        yield around
    yield from _with_changes(job, low_walls(job.patches))
    yield from _with_changes(job, flattened(job.patches))
    yield from _with_changes(job, unbent(job.patches))
    yield from _changed(job, coplanar(job.patches))
    yield from _changed(job, even_tubes(job.patches, sigma))
    yield from bared(job)
    yield from touching(job, sigma)
    for square in (True, False):
        yield from _with_changes(job, angular(job.patches, square))
    yield from symmetric(job)
    for apart in _with_changes(job, straightened(job.patches)):
        yield from bared(apart)
        yield apart
        yield from symmetric(apart)
    yield from _with_changes(job, grooved(job.patches))
    yield from (replace(clear, clear=True) for clear in _changed(job, cleared(job.patches, sigma)))


def touching(job: Job, sigma: float) -> Iterator[Job]:
    """The job with walls that touch the rounder faces that they run into, if any nearly do; fillets smooth."""
    walls = tangent_walls(job.patches, sigma)
    yield from _changed(job, rounded(walls, sigma) or walls)


def _with_changes(job: Job, changes: Sequence[Change]) -> Iterator[Job]:
    """The job after changes, if there are any."""
    if changes:
        yield applied(job, changes)


def _changed(job: Job, patches: Sequence[Patch]) -> Iterator[Job]:
    """The job with as many other patches, if any of them is another one."""
    if any(new is not old for new, old in zip(patches, job.patches, strict=True)):
        yield replace(job, patches=tuple(patches))


def rolled(job: Job, sigma: float) -> Iterator[Job]:
    """The job with its fillets rolled on a solid with sharp edges, if it has any."""
    patches, blends = blended(job.patches, sigma)
    torn = spare(patches, blends, sigma)
    if torn:
        job = applied(job, [Change("without spare patches", tuple(torn), ())])
        patches, blends = blended(job.patches, sigma)
    if blends:
        log = get_logger("brep")
        log.info("%d fillets of edges, %d of corners", *(sum(len(b.faces) == n for b in blends) for n in (2, 3)))
        yield replace(job, patches=tuple(patches), blends=blends)


def bared(job: Job) -> Iterator[Job]:
    """The job without its skins, and without its ramps, if it has any: the faces beside them are extended to meet."""
    for what, gone in (("skins", skins(job.patches)), ("ramps", ramps(job.patches))):
        if gone and len(gone) < len(job.patches):
            names = ", ".join(str(job.patches[i].primitive) for i in gone)
            yield applied(job, [Change(f"without {what} {names}", gone, ())])
