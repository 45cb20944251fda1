"""Small objects for the tests of the views room; makes `sources_support` importable."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from sources_support import SMALL


@pytest.fixture(scope="session")
def bracket():
    """A rendered bracket with its truth."""
    from brepgaussian.views.source_rendered import load_part

    return load_part("bracket", "l_bracket", "", True, SMALL, 1)


@pytest.fixture(scope="session")
def nerf_folder(bracket, tmp_path_factory):
    """The bracket's images as a folder with transforms.json, in a world that is shifted and 40 times as large."""
    folder = tmp_path_factory.mktemp("nerf")
    write_nerf(bracket.views, folder)
    return folder


@pytest.fixture
def photos(nerf_folder, tmp_path):
    """A private copy of the folder with transforms.json, to be damaged."""
    copy = tmp_path / "photos"
    shutil.copytree(nerf_folder, copy)
    return copy


def write_nerf(views, folder):
    from PIL import Image

    (folder / "images").mkdir()
    frames = []
    for k, name in enumerate(views.names):
        rgba = np.dstack([views.rgb[k], views.alpha[k]])
        Image.fromarray(rgba, "RGBA").save(folder / "images" / name)
        pose = np.linalg.inv(views.cameras.cam_from_unit[k])
        pose[:3, 1:3] *= -1
        pose[:3, 3] = 40 * pose[:3, 3] + [3, -2, 9]
        frames.append({"file_path": f"images/{name}", "transform_matrix": pose.tolist()})
    fx, fy, cx, cy = views.cameras.intrinsics[0]
    data = {"fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy, "w": views.cameras.width, "h": views.cameras.height}
    (folder / "transforms.json").write_text(json.dumps({**data, "frames": frames}))
