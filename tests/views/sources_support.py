"""Running the stage `views` on small sources, and making and damaging them."""

import json

import numpy as np
import pytest
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.errors import InputError
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.stage import make_views
from PIL import Image

SMALL = ViewsSettings(
    rendered_views=12, image_size=160, truth_points=2000, mesh_deflection=2e-4, subsamples=4, interreflection=0.0
)


def run(source, path, folder, truth="", settings=SMALL, with_truth=False):
    out = folder / "views.h5", folder / "truth.h5"
    make_views(
        object_name="x",
        source=source,
        path=str(path),
        truth=str(truth),
        out_views=out[0],
        out_truth=out[1] if with_truth else None,
        settings=settings,
    )
    return read_views(out[0]), read_truth(out[1]) if with_truth else None


def refuse(match, source, path, folder, **arguments):
    with pytest.raises(InputError, match=match) as caught:
        run(source, path, folder, **arguments)
    assert caught.value.fix
    assert not (folder / "views.h5").exists()


def edit(folder, change):
    file = folder / "transforms.json"
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))


def write_step(part, path):
    from build123d import export_step

    export_step(part, str(path))
    return path


def abc_object(root, views, layout):
    """Write views in one of the published layouts, without a truth."""
    folder = root / "00000042"
    colour = folder / ("train_img" if layout == "abc_nef" else "color")
    edges = folder / ("train" if layout == "abc_nef" else "edge_DexiNed")
    colour.mkdir(parents=True)
    edges.mkdir()
    frames = []
    for k in range(len(views.names)):
        name = f"{k}_colors.png"
        Image.fromarray(np.dstack([views.rgb[k], views.alpha[k]]), "RGBA").save(colour / name)
        Image.fromarray(views.alpha[k]).save(edges / name)
        fx, fy, cx, cy = views.cameras.intrinsics[k]
        matrix = [[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]]
        pose = np.linalg.inv(views.cameras.cam_from_unit[k])
        if layout == "abc_nef":
            pose[:3, 1:3] *= -1
            frames.append(
                {"file_path": f"./train/{k}_colors", "camera_intrinsics": matrix, "transform_matrix": pose.tolist()}
            )
        else:
            frames.append({"rgb_path": name, "intrinsics": matrix, "camtoworld": pose.tolist()})
    file = "transforms_train.json" if layout == "abc_nef" else "meta_data.json"
    (folder / file).write_text(json.dumps({"frames": frames}))
    return folder
