"""Bad input is named with its file, fault and fix."""

import numpy as np
import pytest
from brepgaussian.errors import InputError
from brepgaussian.views.parts import build_part
from PIL import Image
from sources_support import abc_object, edit, refuse, run, write_step


def test_unknown_source(tmp_path):
    refuse("no source 'video'", "video", "x", tmp_path)


@pytest.mark.parametrize("source", ["nerf", "colmap", "abc_nef", "step"])
def test_missing_path(source, tmp_path):
    refuse("nowhere", source, tmp_path / "nowhere", tmp_path)


@pytest.mark.parametrize("source", ["nerf", "colmap", "abc_nef"])
def test_a_folder_without_cameras(source, tmp_path):
    refuse("holds n", source, tmp_path, tmp_path)


def test_missing_image(photos, tmp_path):
    (photos / "images" / "003.png").unlink()
    refuse(r"003\.png: does not exist", "nerf", photos, tmp_path)


def test_truncated_image(photos, tmp_path):
    file = photos / "images" / "003.png"
    file.write_bytes(file.read_bytes()[:400])
    refuse(r"003\.png: cannot be decoded", "nerf", photos, tmp_path)


def test_image_of_another_size(photos, tmp_path):
    file = photos / "images" / "003.png"
    Image.open(file).resize((120, 120)).save(file)
    refuse(r"003\.png: is 120 x 120 px but its camera is 160 x 160", "nerf", photos, tmp_path)


def test_no_alpha_and_no_mask(photos, tmp_path):
    file = photos / "images" / "003.png"
    Image.open(file).convert("RGB").save(file)
    refuse(r"003\.png: has no alpha channel", "nerf", photos, tmp_path)


def test_empty_silhouette(photos, tmp_path):
    Image.new("RGBA", (160, 160)).save(photos / "images" / "003.png")
    refuse(r"003\.png: the silhouette is empty", "nerf", photos, tmp_path)


def test_opaque_image(photos, tmp_path):
    Image.new("RGBA", (160, 160), (9, 9, 9, 255)).save(photos / "images" / "003.png")
    refuse(r"003\.png: the silhouette fills", "nerf", photos, tmp_path)


def test_too_few_views(photos, tmp_path):
    edit(photos, lambda data: data.update(frames=data["frames"][:7]))
    refuse("has 7 views", "nerf", photos, tmp_path)


@pytest.mark.parametrize(
    ("matrix", "match"),
    [
        (np.zeros((4, 4)), "singular"),
        (np.full((4, 4), np.nan), "not a finite"),
        (np.eye(3), "not a finite"),
        (np.diag([1.0, 1, -1, 1]), "mirrors"),
        (np.array([[1, 0.2, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]), "not orthogonal"),
        ([["a"] * 4] * 4, "not a finite"),
    ],
)
def test_bad_poses(photos, tmp_path, matrix, match):
    edit(photos, lambda data: data["frames"][3].update(transform_matrix=np.asarray(matrix).tolist()))
    refuse(match, "nerf", photos, tmp_path)


def test_bad_intrinsics(photos, tmp_path):
    edit(photos, lambda data: data.update(fl_x=-5))
    refuse("focal length", "nerf", photos, tmp_path)
    edit(photos, lambda data: data.update(fl_x="wide"))
    refuse("fl_x is 'wide'", "nerf", photos, tmp_path)
    edit(photos, lambda data: data.pop("fl_x"))
    refuse("no focal length", "nerf", photos, tmp_path)


def test_fisheye_is_refused(photos, tmp_path):
    edit(photos, lambda data: data.update(camera_model="OPENCV_FISHEYE", k1=0.1))
    refuse("OPENCV_FISHEYE is not supported", "nerf", photos, tmp_path)


def test_broken_json(photos, tmp_path):
    (photos / "transforms.json").write_text('{"frames": [')
    refuse("not valid JSON", "nerf", photos, tmp_path)
    (photos / "transforms.json").write_text('{"frames": []}')
    refuse("lists no frames", "nerf", photos, tmp_path)
    (photos / "transforms.json").write_text('{"frames": [{"file_path": "a"}]}')
    refuse("lacks file_path or transform_matrix", "nerf", photos, tmp_path)


def test_object_cut_off_by_the_border(photos, tmp_path):
    for file in (photos / "images").iterdir():
        image = Image.open(file)
        box = image.getchannel("A").getbbox()
        moved = Image.new("RGBA", image.size)
        moved.paste(image, (-box[0] - 5, 0))
        moved.save(file)
    refuse("cut off by the image border in 12 of 12", "nerf", photos, tmp_path)


def test_cameras_that_do_not_fit_the_silhouettes(photos, tmp_path):
    def shuffle(data):
        poses = [frame["transform_matrix"] for frame in data["frames"]]
        for k, frame in enumerate(data["frames"]):
            frame["transform_matrix"] = poses[(k + 5) % len(poses)]

    edit(photos, shuffle)
    refuse("disagree|no volume in common", "nerf", photos, tmp_path)


def test_opencv_axes_taken_for_opengl(photos, tmp_path):
    def flip(data):
        for frame in data["frames"]:
            pose = np.array(frame["transform_matrix"])
            pose[:3, 1:3] *= -1
            frame["transform_matrix"] = pose.tolist()

    edit(photos, flip)
    refuse("look away from the object|no volume in common", "nerf", photos, tmp_path)


def test_damaged_colmap_model(photos, tmp_path):
    sparse = photos / "sparse" / "0"
    sparse.mkdir(parents=True)
    (sparse / "cameras.bin").write_bytes(b"\1\0\0\0\0\0\0\0\2")
    (sparse / "images.bin").write_bytes(b"")
    refuse("is damaged", "colmap", photos, tmp_path)


def test_bad_step_files(tmp_path):
    from build123d import Box, Compound, Face, Pos

    text = tmp_path / "text.step"
    text.write_text("hello")
    refuse("is not a STEP file", "step", text, tmp_path)
    torn = write_step(build_part("cup"), tmp_path / "torn.step")
    torn.write_bytes(torn.read_bytes()[:900])
    refuse("damaged or empty STEP file|holds no solid", "step", torn, tmp_path)
    sheet = write_step(Face.make_rect(3, 4), tmp_path / "sheet.step")
    refuse("holds no solid", "step", sheet, tmp_path)
    two = write_step(Compound([Box(1, 1, 1), Pos(5, 0, 0) * Box(1, 1, 1)]), tmp_path / "two.step")
    refuse("holds 2 solids", "step", two, tmp_path)


def test_a_face_that_the_kernel_does_not_mesh(tmp_path, monkeypatch):
    monkeypatch.setattr("brepgaussian.views.mesh._is_meshed", lambda face: False)
    file = write_step(build_part("cup"), tmp_path / "cup.step")
    refuse("cup.step: has faces that the kernel cannot triangulate", "step", file, tmp_path)


def test_damaged_truth_of_abc(bracket, tmp_path):
    folder = abc_object(tmp_path / "data", bracket.views, "abc_nef")
    (folder / "a_trimesh_1.obj").write_text("v 0 0 0\nf 1 2 3\n")
    (folder / "a_features_1.yml").write_text("surfaces: [{face_indices: [0], type: Plane}]\ncurves: []\n")
    refuse("no complete triangle mesh", "abc_nef", folder, tmp_path, with_truth=True)
    (folder / "a_trimesh_1.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    refuse("does not fit the silhouettes", "abc_nef", folder, tmp_path, with_truth=True)
    (folder / "a_features_1.yml").write_text("surfaces: [")
    refuse("not a readable feature list", "abc_nef", folder, tmp_path, with_truth=True)


def test_no_truth_where_one_is_asked_for(nerf_folder, tmp_path):
    with pytest.raises(InputError, match="no truth is known"):
        run("nerf", nerf_folder, tmp_path, with_truth=True)
