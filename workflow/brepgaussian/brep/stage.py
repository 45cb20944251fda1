"""Stage `brep`: primitives and points to one closed solid, published as STEP."""

import time
from pathlib import Path

import numpy as np

from brepgaussian.artifacts.base import Provenance
from brepgaussian.artifacts.brep import Brep
from brepgaussian.artifacts.points import Points, read_labellings
from brepgaussian.artifacts.primitives import read_primitives
from brepgaussian.artifacts.views import read_views
from brepgaussian.brep.curves import wireframe
from brepgaussian.brep.ladder import climb, make_job, other_jobs
from brepgaussian.brep.worker import Worker
from brepgaussian.errors import StageError
from brepgaussian.log import get_logger
from brepgaussian.settings.base import digest
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.threads import bind

_LEAST_POINTS = 4  # a tetrahedron
_PUBLISH_LIMIT_S = 60.0


def build_brep(
    views_path: str | Path,
    points_path: str | Path,
    primitives_path: str | Path,
    out_step: str | Path,
    out_glb: str | Path,
    out_h5: str | Path,
    settings: BrepSettings,
    threads: int = 1,
) -> None:
    """Build the closed solid of an object and publish it.

    Args:
        views_path: `views.h5`: silhouettes as evidence, the object's name, the world frame and unit.
        points_path: `points.ply`.
        primitives_path: `primitives.h5`, whose supports index the points.
        out_step: STEP of one closed valid solid in the user's frame and unit.
        out_glb: tessellation for viewers, same frame.
        out_h5: curves, corners, surfaces and the gate report, unit frame.
        settings: of this stage.
        threads: numeric libraries are bound to this number.

    Raises:
        ArtifactError: an input is missing or damaged.
        StageError: the points span no volume.
    """
    bind(threads)
    log, start = get_logger("brep"), time.monotonic()
    log.info("settings %s", settings)
    views, primitives = read_views(views_path).as_taken, read_primitives(primitives_path)
    points, *labellings = read_labellings(points_path)
    _check(points, points_path)
    with Worker() as worker:
        job = make_job(views, points, primitives, settings)
        outcome = climb(worker, job, points, views, other_jobs(points, primitives, job, labellings))
        name = views.object_name or Path(views_path).parent.name or "part"
        step = (outcome.shape, views.world_from_unit, views.unit, name, str(out_step))
        worker.call("publish:write_step", step, _PUBLISH_LIMIT_S)
        worker.call("publish:write_glb", (outcome.shape, views.world_from_unit, name, str(out_glb)), _PUBLISH_LIMIT_S)
    frame = wireframe(outcome.structure, outcome.surfaces, points)
    brep = Brep(outcome.surfaces, frame.curves, frame.corners, outcome.report | frame.report, frame.clusters)
    brep.write(out_h5, Provenance(views.object_name, digest(settings)))
    log.info("published rung %s in %.1f s", outcome.report["rung"], time.monotonic() - start)


def _check(points: Points, path: str | Path) -> None:
    if len(points.xyz) < _LEAST_POINTS or np.ptp(points.xyz, axis=0).max() == 0:
        raise StageError("holds too few points for a solid", file=path, fix="check masks and stage 1 of this object")
