import json

import pytest
from brepgaussian.project.check import missing, tell
from brepgaussian.project.objects import ObjectRow


def abc_object(folder, layout, images, frames=4, truth=True):
    name, colour, key = {
        "abc_nef": ("transforms_train.json", "train_img", "file_path"),
        "emap": ("meta_data.json", "color", "rgb_path"),
    }[layout]
    prefix, suffix = ("./train/", "") if layout == "abc_nef" else ("", ".png")
    (folder / colour).mkdir(parents=True)
    entries = [{key: f"{prefix}{k}_colors{suffix}"} for k in range(frames)]
    (folder / name).write_text(json.dumps({"frames": entries}))
    for k in range(images):
        (folder / colour / f"{k}_colors.png").touch()
    if truth:
        (folder / "x_trimesh_1.obj").touch()
        (folder / "x_features_1.yml").touch()
    return ObjectRow(folder.name, "abc_nef", str(folder))


@pytest.mark.parametrize("layout", ["abc_nef", "emap"])
def test_what_is_missing_of_a_data_set_is_listed(tmp_path, layout):
    whole = abc_object(tmp_path / "whole", layout, 4)
    torn = abc_object(tmp_path / "torn", layout, 2, truth=False)
    assert missing(whole) == []
    said = tell([whole, torn])
    assert said.startswith("torn: 2 of 4 images are missing in ")
    assert "2_colors, 3_colors; no truth" in said


def test_a_folder_without_cameras_and_one_with_damaged_ones(tmp_path):
    row = abc_object(tmp_path / "a", "abc_nef", 4)
    (tmp_path / "a" / "transforms_train.json").write_text("{")
    assert missing(row) == ["transforms_train.json cannot be read"]
    (tmp_path / "a" / "transforms_train.json").unlink()
    assert missing(row) == ["neither transforms_train.json nor meta_data.json"]


def test_other_sources_lack_their_path_or_their_truth(tmp_path):
    (tmp_path / "a.step").touch()
    assert missing(ObjectRow("x", "part", "hex_nut")) == []
    assert missing(ObjectRow("x", "step", str(tmp_path / "a.step"))) == []
    assert missing(ObjectRow("x", "nerf", str(tmp_path / "b"))) == [f"{tmp_path / 'b'} does not exist"]
    truth = str(tmp_path / "truth.step")
    assert missing(ObjectRow("x", "nerf", str(tmp_path), truth)) == [f"its truth {truth} does not exist"]
