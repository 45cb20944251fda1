"""Every source ends in the unit frame; reruns are byte-identical."""

import dataclasses
import json
import math
import struct
from pathlib import Path

import numpy as np
import pytest
from brepgaussian.errors import InputError
from brepgaussian.views.parts import build_part
from brepgaussian.views.photos import undistort
from brepgaussian.views.source import chosen_views
from brepgaussian.views.source_colmap import rotation_matrix
from brepgaussian.views.stage import make_views
from brepgaussian.views.truth import transformed, unit_from_world
from build123d import Solid
from PIL import Image
from sources_support import SMALL, edit, run, write_step


def test_a_part_is_byte_identical_on_rerun_and_with_two_threads(tmp_path):
    contents = []
    for k, threads in enumerate((1, 1, 2)):
        out = tmp_path / str(k)
        make_views(
            object_name="x", source="part", path="counterbore:3", out_views=out / "v.h5", out_truth=out / "t.h5",
            settings=dataclasses.replace(SMALL, interreflection=0.8), threads=threads,
        )  # fmt: skip
        contents.append(((out / "v.h5").read_bytes(), (out / "t.h5").read_bytes()))
    assert contents[0] == contents[1] == contents[2]


def test_a_step_file_is_the_part_it_was_written_from(tmp_path, bracket):
    file = write_step(build_part("l_bracket"), tmp_path / "bracket.step")
    views, truth = run("step", file, tmp_path, with_truth=True)
    assert views.unit == "mm"
    np.testing.assert_allclose(views.world_from_unit, bracket.views.world_from_unit, atol=1e-6)
    assert np.abs(views.alpha.astype(int) - bracket.views.alpha).max() <= 16
    assert sorted(truth.face_types) == sorted(bracket.truth.face_types)
    assert (truth.edge_count, truth.vertex_count) == (22, 12)
    assert truth.volume == pytest.approx(bracket.truth.volume, rel=1e-6)


def test_world_from_unit_gives_back_millimetres(bracket):
    world = bracket.views.world_from_unit
    corners = bracket.truth.mesh_vertices @ world[:3, :3].T + world[:3, 3]
    box = build_part("l_bracket").bounding_box()
    np.testing.assert_allclose(corners.min(axis=0), [box.min.X, box.min.Y, box.min.Z], atol=1e-4)
    np.testing.assert_allclose(corners.max(axis=0), [box.max.X, box.max.Y, box.max.Z], atol=1e-4)


def test_photos_find_the_unit_frame_from_silhouettes(nerf_folder, bracket, tmp_path):
    views, _ = run("nerf", nerf_folder, tmp_path)
    assert views.unit == "arbitrary"
    scale = np.cbrt(np.linalg.det(views.world_from_unit[:3, :3]))
    assert scale == pytest.approx(40, rel=0.06)  # a pixel is .02 here, and the hull of 12 views exceeds the object
    np.testing.assert_allclose(views.world_from_unit[:3] @ [0.5, 0.5, 0.5, 1], [23, 18, 29], atol=1)
    pixel, _ = views.cameras.project(3, np.full((1, 3), 0.5))
    np.testing.assert_allclose(pixel, 80, atol=2)
    assert (views.alpha == bracket.views.alpha).all()


def test_photos_with_the_truth_as_step(nerf_folder, tmp_path):
    """The STEP must share the world frame: 40 units per unit-frame length, shifted."""
    part = build_part("l_bracket").wrapped
    unit = unit_from_world(part)
    world = np.array([[40, 0, 0, 3], [0, 40, 0, -2], [0, 0, 40, 9], [0, 0, 0, 1.0]])
    file = write_step(Solid(transformed(part, world @ unit)), tmp_path / "truth.step")
    views, truth = run("nerf", nerf_folder, tmp_path, truth=file, with_truth=True)
    assert len(truth.face_types) == 10
    assert truth.face_ids.shape == views.alpha.shape
    wrong = write_step(Solid(transformed(part, unit)), tmp_path / "wrong.step")
    with pytest.raises(InputError, match="does not fit the silhouettes"):
        run("nerf", nerf_folder, tmp_path, truth=wrong, with_truth=True)


def test_masks_stand_in_for_alpha(photos, bracket, tmp_path):
    (photos / "masks").mkdir()
    for image in sorted((photos / "images").iterdir()):
        rgba = np.asarray(Image.open(image))
        Image.fromarray(rgba[..., :3]).save(image)
        Image.fromarray(rgba[..., 3]).save(photos / "masks" / image.name)
    views, _ = run("nerf", photos, tmp_path)
    assert (views.alpha == bracket.views.alpha).all()
    assert (views.rgb == bracket.views.rgb).all()


def test_blenders_angle_equals_the_focal_length(photos, tmp_path):
    first, _ = run("nerf", photos, tmp_path)

    def change(data):
        data["camera_angle_x"] = 2 * math.atan(data["w"] / 2 / data["fl_x"])
        for key in ("fl_x", "fl_y", "cx", "cy", "w", "h"):
            del data[key]
        for frame in data["frames"]:
            frame["file_path"] = frame["file_path"].removesuffix(".png")

    edit(photos, change)
    second, _ = run("nerf", photos, tmp_path)
    np.testing.assert_allclose(first.cameras.intrinsics, second.cameras.intrinsics, rtol=1e-12)


@pytest.mark.parametrize("binary", [True, False])
def test_a_colmap_model_gives_the_same_views(photos, tmp_path, binary):
    reference, _ = run("nerf", photos, tmp_path)
    data = json.loads((photos / "transforms.json").read_text())
    sparse = photos / "sparse" / "0"
    sparse.mkdir(parents=True)
    poses = []
    for k, frame in enumerate(data["frames"]):
        pose = np.array(frame["transform_matrix"])
        pose[:3, 1:3] *= -1
        pose = np.linalg.inv(pose)
        poses.append((3 * k + 5, quaternion(pose[:3, :3]), pose[:3, 3], Path(frame["file_path"]).name))
    parameters = [data[key] for key in ("fl_x", "fl_y", "cx", "cy")]
    if binary:
        camera = struct.pack("<QiiQQ4d", 1, 7, 1, data["w"], data["h"], *parameters)
        (sparse / "cameras.bin").write_bytes(camera)
        images = struct.pack("<Q", len(poses))
        for number, q, t, name in poses:
            images += struct.pack("<i7di", number, *q, *t, 7) + name.encode() + b"\0" + struct.pack("<Q", 1)
            images += struct.pack("<ddq", 1.0, 2.0, -1)
        (sparse / "images.bin").write_bytes(images)
    else:
        numbers = " ".join(map(repr, map(float, parameters)))
        (sparse / "cameras.txt").write_text(f"# cameras\n7 PINHOLE {data['w']} {data['h']} {numbers}\n")
        lines = ["# images"]
        for number, q, t, name in poses:
            lines += [f"{number} {' '.join(repr(float(x)) for x in (*q, *t))} 7 {name}", ""]
        (sparse / "images.txt").write_text("\n".join(lines) + "\n")
    views, _ = run("colmap", photos, tmp_path)
    assert views.names == reference.names
    np.testing.assert_allclose(views.cameras.cam_from_unit, reference.cameras.cam_from_unit, atol=1e-9)
    np.testing.assert_allclose(views.cameras.intrinsics, reference.cameras.intrinsics)


def quaternion(rotation):
    from scipy.spatial.transform import Rotation

    x, y, z, w = Rotation.from_matrix(rotation).as_quat()
    return np.array([w, x, y, z])


def test_rotation_of_a_quaternion():
    q = np.array([0.3, -0.5, 0.7, 0.2])
    np.testing.assert_allclose(quaternion(rotation_matrix(q)) @ q / np.linalg.norm(q), 1, atol=1e-12)


def test_undistortion_moves_pixels_to_where_a_pinhole_sees_them():
    """A disc of known centre, drawn where a distorting lens puts it, ends where the pinhole sees it."""
    intrinsics, distortion = np.array([300.0, 300, 100, 90]), np.array([0.2, -0.05, 0.002, -0.001, 0.0])
    x, y = 0.2, -0.15
    r2 = x * x + y * y
    k1, k2, p1, p2, _ = distortion
    radial = 1 + k1 * r2 + k2 * r2 * r2
    u = 300 * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + 100
    v = 300 * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + 90
    rows, columns = np.mgrid[:200, :200] + 0.5
    image = np.zeros((200, 200, 4), np.uint8)
    image[..., 3] = np.clip(255 * (6 - np.hypot(columns - u, rows - v)), 0, 255)
    image[..., :3] = (image[..., 3:] > 0) * 80
    moved = undistort(image, intrinsics, distortion)
    weight = moved[..., 3].astype(float)
    center = [(weight * columns).sum() / weight.sum(), (weight * rows).sum() / weight.sum()]
    np.testing.assert_allclose(center, [300 * x + 100, 300 * y + 90], atol=0.05)
    assert (np.abs(moved[weight > 0][:, :3].astype(int) - 80) <= 1).all()


def test_fewer_views_are_evenly_chosen(tmp_path):
    assert chosen_views(50, 0).tolist() == list(range(50))
    assert chosen_views(50, 99).tolist() == list(range(50))
    assert chosen_views(50, 20)[:5].tolist() == [1, 3, 6, 8, 11]
    views, _ = run("part", "block_hole", tmp_path, settings=dataclasses.replace(SMALL, view_count=9))
    assert len(views.names) == 9
