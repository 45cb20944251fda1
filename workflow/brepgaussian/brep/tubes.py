"""Pipes that go on in a bend: a cylinder beside a torus about whose tube's centre line it runs is as wide as the tube.

Points may know the width of a short piece too badly for primitives to say so (pipe_elbow: 1.6 noises). Sheets of two
widths neither meet nor touch, and nothing lies inside of them.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from brepgaussian.brep.patches import Patch, neighbours
from brepgaussian.geometry.surfaces import Surface, unit
from brepgaussian.primitives.relations import RESIDUALS

_EXACT = 1e-6  # unit frame: centre lines and widths that are one
_LINE_NOISES = 1.0  # by which the centre lines of one pipe may miss each other
_TILT = np.sin(np.radians(1.0))  # of a pipe against its bend's plane
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
                result[k] = replace(patches[k], surface=_continued(patches[k].surface, ring))
    return result


def _goes_on(pipe: Surface, ring: Surface, noise: float) -> bool:
    """Whether a cylinder's axis about touches a torus's centre line, and it is about as wide as the tube; not quite."""
    tilt, *line, width = (abs(float(v)) for v in RESIDUALS["bend"](pipe, ring))
    about = tilt < _TILT and max(line) < _LINE_NOISES * noise and width < _WIDTH_NOISES * noise
    return pipe.flipped == ring.flipped and about and max(tilt, *line, width) > _EXACT


def _continued(pipe: Surface, ring: Surface) -> Surface:
    """The cylinder that goes on smoothly where a torus' tube ends, nearest to another one."""
    axis = unit(pipe.axis - (pipe.axis @ ring.axis) * ring.axis)
    offset = pipe.origin - ring.origin
    arm = unit(offset - (offset @ axis) * axis - (offset @ ring.axis) * ring.axis)
    along = ring.origin + (offset @ axis) * axis
    return replace(pipe, origin=along + ring.radius * arm, axis=axis, radius=ring.minor)
