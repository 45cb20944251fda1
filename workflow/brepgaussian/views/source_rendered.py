"""Sources `part` and `step`: a solid that is rendered, with its exact truth."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from brepgaussian.artifacts.views import Views
from brepgaussian.errors import InputError
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.log import get_logger, progress
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.mesh import mesh_solid
from brepgaussian.views.parts import build_part, parse_part
from brepgaussian.views.render import render
from brepgaussian.views.rig import rig
from brepgaussian.views.source import Loaded, chosen_views
from brepgaussian.views.step_file import read_solid
from brepgaussian.views.truth import transformed, truth_of_solid, unit_from_world

LOG = get_logger("views")
_LIGHT_DEFLECTION, _LIGHT_ANGLE_DEG = 1e-3, 10.0  # of the coarse mesh that carries bounced light


def load_part(name: str, path: str, truth: str, want_truth: bool, settings: ViewsSettings, threads: int) -> Loaded:
    """Render a bundled part; `path` is `name` or `name:seed`."""
    part, seed = parse_part(path)
    return _load_solid(name, build_part(part, seed).wrapped, want_truth, settings, threads)


def load_step(name: str, path: str, truth: str, want_truth: bool, settings: ViewsSettings, threads: int) -> Loaded:
    """Render a STEP file of one solid; the world frame is the file's, in mm whatever the file's unit."""
    try:
        return _load_solid(name, read_solid(Path(path)), want_truth, settings, threads)
    except InputError as error:  # what the kernel cannot do with a solid it says without its file
        raise InputError(error.fault, file=error.file or path, fix=error.fix) from error


def _load_solid(name: str, world_solid: Any, want_truth: bool, settings: ViewsSettings, threads: int) -> Loaded:
    matrix = unit_from_world(world_solid)
    solid = transformed(world_solid, matrix)
    # The coarse mesh first: the kernel keeps a finer one when asked for a coarser one.
    coarse = mesh_solid(solid, _LIGHT_DEFLECTION, _LIGHT_ANGLE_DEG)
    known, mesh = truth_of_solid(solid, settings)
    LOG.info("rendering %d faces, %d triangles", len(known.face_types), len(mesh.triangles))
    everywhere = rig(settings)
    keep = chosen_views(len(everywhere), settings.view_count)
    cameras = Cameras(everywhere.intrinsics[keep], everywhere.cam_from_unit[keep], everywhere.width, everywhere.height)
    pictures = render(mesh, coarse, cameras, settings, threads, progress(range(len(keep)), "rendering", len(keep)))
    views = Views(
        object_name=name,
        names=tuple(f"{i:03d}.png" for i in keep),
        rgb=pictures.rgb,
        alpha=pictures.alpha,
        cameras=cameras,
        world_from_unit=np.asarray(np.linalg.inv(matrix), np.float64),
        unit="mm",
    )
    return Loaded(views, replace(known, face_ids=pictures.face_ids) if want_truth else None)
