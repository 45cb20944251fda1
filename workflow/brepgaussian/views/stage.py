"""Entry of the stage `views`: from any source to `views.h5` and `truth.h5`."""

import dataclasses
from collections.abc import Callable
from importlib import import_module
from pathlib import Path

import numpy as np

from brepgaussian.artifacts.base import Provenance
from brepgaussian.errors import InputError
from brepgaussian.log import get_logger
from brepgaussian.settings.base import digest
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.checks import check_silhouettes
from brepgaussian.views.degrade import degrade_photos
from brepgaussian.views.noise import denoised
from brepgaussian.views.source import Loaded

LOG = get_logger("views")
Loader = Callable[[str, str, str, bool, ViewsSettings, int], Loaded]
_RENDERED = "source_rendered"  # has put noise into its images itself
_LOADERS = {
    "part": (_RENDERED, "load_part"),
    "step": (_RENDERED, "load_step"),
    "abc_nef": ("source_abc_nef", "load_abc_nef"),
    "nerf": ("source_nerf", "load_nerf"),
    "colmap": ("source_colmap", "load_colmap"),
}


def make_views(
    *,
    object_name: str,
    source: str,
    path: str,
    truth: str = "",
    out_views: str | Path,
    out_truth: str | Path | None,
    settings: ViewsSettings,
    threads: int = 1,
) -> None:
    """Bring one object into the unit frame: images, silhouettes, cameras, and the truth where it is known.

    Args:
        object_name: the object's name.
        source: `part`, `step`, `abc_nef`, `nerf` or `colmap`.
        path: a bundled part (`name` or `name:seed`), a STEP file, or a folder.
        truth: for `abc_nef` a folder with the truth files if they don't lie beside the images; for `nerf`
            and `colmap` a STEP file in the same world frame; else empty.
        out_views: path of `views.h5`.
        out_truth: path of `truth.h5`, or None to write none.
        settings: settings of this stage.
        threads: for ray casting.

    Raises:
        InputError: the input is at fault; names the file, the fault and the fix.
    """
    loaded = _loader(source)(object_name, path, truth, out_truth is not None, settings, threads)
    check_silhouettes(loaded.views, path)
    provenance = Provenance(object_name, digest(settings))
    views = loaded.views if _LOADERS[source][0] == _RENDERED else degrade_photos(loaded.views, settings)
    if settings.denoise:
        views = denoised(views, threads)
    views.write(out_views, provenance)
    LOG.info(
        "%s: %d views of %d x %d px, world unit %s, scale %.6g per unit-frame length",
        object_name,
        len(views.names),
        views.cameras.width,
        views.cameras.height,
        views.unit,
        np.cbrt(np.linalg.det(views.world_from_unit[:3, :3])),
    )
    if out_truth is None:
        return
    if loaded.truth is None:
        raise InputError("no truth is known for this object", file=path, fix="give its truth or ask for views only")
    known = loaded.truth if settings.face_ids else dataclasses.replace(loaded.truth, face_ids=None)
    known.write(out_truth, provenance)
    LOG.info("truth: %d faces, %d edges, %d vertices", len(known.face_types), known.edge_count, known.vertex_count)


def _loader(source: str) -> Loader:
    """The function that loads a source; its heavy imports happen only here."""
    if source not in _LOADERS:
        raise InputError(f"there is no source {source!r}", fix=f"use one of: {', '.join(_LOADERS)}")
    module, function = _LOADERS[source]
    return getattr(import_module(f"brepgaussian.views.{module}"), function)  # type: ignore[no-any-return]
