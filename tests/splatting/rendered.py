"""Views and truth of solids that a test draws."""

from brepgaussian.artifacts.truth import Truth, read_truth
from brepgaussian.artifacts.views import Views, read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.stage import make_views
from build123d import export_step


def rendered(tmp_path, part, count: int = 30, size: int = 400) -> tuple[Views, Truth]:
    """Views and truth of a build123d solid: `count` views of `size` px."""
    export_step(part, tmp_path / "part.step")
    settings = ViewsSettings(rendered_views=count, image_size=size)
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    make_views(object_name="part", source="step", path=str(tmp_path / "part.step"), settings=settings, **files)
    return read_views(files["out_views"]), read_truth(files["out_truth"])
