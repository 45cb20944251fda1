"""Pipes that go on in a bend: a cylinder beside a torus about whose tube's centre line it runs is as wide as the tube.

Points may know the width of a short piece too badly for primitives to say so (pipe_elbow: 1.6 noises). Sheets of two
widths neither meet nor touch, and nothing lies inside of them.
"""

from collections.abc import Sequence
from dataclasses import replace

from brepgaussian.brep.patches import Patch, neighbours
from brepgaussian.geometry.surfaces import Surface
from brepgaussian.primitives.relations import RESIDUALS

_LINE = 1e-6  # unit frame: centre lines that are one
_WIDTH_NOISES = 5.0  # by which the widths of one pipe may differ; a larger step is one


def even_tubes(patches: Sequence[Patch], noise: float) -> list[Patch]:
    """The patches, every piece of a pipe as wide as the bend beside it that most points show.

    Args:
        patches: those of a job.
        noise: of the points, unit frame.
    """
    result = list(patches)
    bends = sorted((i for i, p in enumerate(patches) if p.surface.kind == "torus"), key=lambda i: len(patches[i].xyz))
    for i in bends:
        ring = patches[i].surface
        for k in neighbours(i, patches, "cylinder"):
            if _goes_on(patches[k].surface, ring, noise):
                result[k] = replace(patches[k], surface=replace(patches[k].surface, radius=ring.minor))
    return result


def _goes_on(pipe: Surface, ring: Surface, noise: float) -> bool:
    """Whether a cylinder's axis touches a torus's centre line, and it is about as wide as the tube, but not quite."""
    *line, width = (abs(float(v)) for v in RESIDUALS["bend"](pipe, ring))
    return pipe.flipped == ring.flipped and max(line) < _LINE and 0 < width < _WIDTH_NOISES * noise
