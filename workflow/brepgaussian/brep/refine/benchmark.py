"""Benchmark of the refinement: noisy points of bundled parts -> primitives -> solid -> refined on renderings.

`python -m brepgaussian.brep.refine.benchmark [--objects cup:3 ...] [--views 30] [--sigma .005] [--noise 0]`
prints one line an object: mean surface error (both directions averaged, unit frame) before and after.
"""

import argparse
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from brepgaussian.brep.damage import damaged
from brepgaussian.brep.ladder import climb, make_job
from brepgaussian.brep.refine.mesh import FaceMesh, from_bytes, from_solid
from brepgaussian.brep.worker import Worker
from brepgaussian.log import setup
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.primitives import PrimitivesSettings
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.threads import bind

_SAMPLES = 20_000


def surface_error(first: FaceMesh, second: FaceMesh) -> float:
    """Mean distance of two triangulations, both directions averaged."""
    return 0.5 * (_one_way(first, second) + _one_way(second, first))


def _one_way(source: FaceMesh, target: FaceMesh) -> float:
    import open3d as o3d

    rng, corners = np.random.default_rng(0), source.vertices[source.triangles]
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    pick = rng.choice(len(area), _SAMPLES, p=area / area.sum())
    points = np.einsum("nk,nki->ni", rng.dirichlet([1, 1, 1], _SAMPLES), corners[pick])
    core: Any = o3d.core
    scene = o3d.t.geometry.RaycastingScene(nthreads=1)
    scene.add_triangles(
        core.Tensor(target.vertices.astype(np.float32)), core.Tensor(target.triangles.astype(np.uint32))
    )
    return float(scene.compute_distance(core.Tensor(points.astype(np.float32)), nthreads=1).numpy().mean())


def run(path: str, settings: ViewsSettings, sigma: float, seed: int, worker: Worker) -> str:
    """One line of the table for a bundled part `name` or `name:seed`."""
    from brepgaussian.views.parts import build_part, parse_part
    from brepgaussian.views.source_rendered import load_part
    from brepgaussian.views.truth import transformed, unit_from_world

    loaded = load_part(path, path, "", True, settings, 1)
    assert loaded.truth is not None
    world = build_part(*parse_part(path)).wrapped
    exact = from_solid(transformed(world, unit_from_world(world)))
    points = damaged(loaded.truth, sigma, 0.01, "none", seed)
    job = make_job(loaded.views, points, primitives_of(points, PrimitivesSettings()), BrepSettings())
    start = time.monotonic()
    before = climb(worker, job, points)
    middle = time.monotonic()
    after = climb(worker, job, points, loaded.views)
    seconds = (time.monotonic() - middle) - (middle - start)
    errors = [surface_error(from_bytes(o.shape), exact) for o in (before, after)]
    report = after.report
    return (
        f"{path} faces {len(after.structure.faces)}/{len(loaded.truth.face_types)} "
        f"error {errors[0]:.2e} -> {errors[1]:.2e} silhouette {report['silhouette_px']} px "
        f"IoU {report['mask_iou']:.5f} accepted {report['accepted']} refined {report['refined']} in {seconds:.1f} s"
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--objects", nargs="*", default=["block_hole", "flange", "fillet_bracket", "pocket_plate"])
    parser.add_argument("--views", type=int, default=30)
    parser.add_argument("--size", type=int, default=800)
    parser.add_argument("--sigma", type=float, default=0.005)
    parser.add_argument("--noise", type=float, default=0.0)
    parser.add_argument("--jpeg", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args(arguments)
    bind(1)
    setup(level=30)
    settings = ViewsSettings(
        rendered_views=options.views, image_size=options.size, noise=options.noise, jpeg_quality=options.jpeg
    )
    with Worker() as worker:
        for path in options.objects:
            print(run(path, settings, options.sigma, options.seed, worker), flush=True)


if __name__ == "__main__":
    main()
