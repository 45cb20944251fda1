"""Views and truth of solids that a test draws, and how much of the truth a hull of them misses."""

import numpy as np
from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.hull import _UNITS, Hull, carve, hull_field, silhouette_distance
from brepgaussian.views.stage import make_views
from build123d import export_step


def rendered(tmp_path, part, count: int = 30, size: int = 400) -> tuple[Views, Truth]:
    """Views and truth of a build123d solid: `count` views of `size` px."""
    export_step(part, tmp_path / "part.step")
    settings = ViewsSettings(rendered_views=count, image_size=size)
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    make_views(object_name="part", source="step", path=str(tmp_path / "part.step"), settings=settings, **files)
    return read_views(files["out_views"]), read_truth(files["out_truth"])


def missed(views: Views, truth: Truth) -> tuple[float, float]:
    """Shares of the truth's volume by which the carved hull has too much, and too little, 1.5 cells off its faces."""
    return wrong_of(carve(views, 128, concavities=True)[0], truth)


def wrong_of(hull: Hull, truth: Truth) -> tuple[float, float]:
    """The same of a hull of 128 cells."""
    solid = Scene(truth.mesh_vertices, truth.mesh_triangles)
    found = Scene(hull.vertices, hull.triangles)
    low, high = truth.mesh_vertices.min(axis=0), truth.mesh_vertices.max(axis=0)
    points = np.random.default_rng(1).uniform(low, high, (100_000, 3))
    near, real = found.signed_distance(points), solid.signed_distance(points)
    clear = np.abs(real) > 1.5 / 128
    inside = (real < 0).sum()
    return ((near < 0) & (real > 0) & clear).sum() / inside, ((near > 0) & (real < 0) & clear).sum() / inside


def silhouette_volume(views: Views, resolution: int) -> Volume:
    """What silhouettes leave, on a grid of `resolution`^3."""
    silhouettes = np.stack([np.clip(silhouette_distance(alpha) * _UNITS, -32000, 32000) for alpha in views.alpha])
    return Volume(*hull_field(silhouettes.astype(np.int16), views.cameras, resolution, 1))
