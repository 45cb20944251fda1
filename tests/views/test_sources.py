"""Every source ends in the unit frame; reruns are byte-identical; bad input is named."""

import dataclasses
import json
import math
import shutil
import struct
from pathlib import Path

import numpy as np
import pytest
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.errors import InputError
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.abc_nef_layout import find_abc_nef, find_truth, has_truth
from brepgaussian.views.parts import build_part
from brepgaussian.views.photos import undistort
from brepgaussian.views.source import chosen_views
from brepgaussian.views.source_colmap import rotation_matrix
from brepgaussian.views.stage import make_views
from brepgaussian.views.truth import transformed, unit_from_world
from build123d import Solid
from PIL import Image

SMALL = ViewsSettings(
    rendered_views=12, image_size=160, truth_points=2000, mesh_deflection=2e-4, subsamples=4, interreflection=0.0
)
NUT = Path(__file__).parents[3] / "shared/data/abc_nef/00000006"


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


@pytest.fixture
def photos(nerf_folder, tmp_path):
    """A private copy of the folder with transforms.json, to be damaged."""
    copy = tmp_path / "photos"
    shutil.copytree(nerf_folder, copy)
    return copy


def edit(folder, change):
    file = folder / "transforms.json"
    data = json.loads(file.read_text())
    change(data)
    file.write_text(json.dumps(data))


def write_step(part, path):
    from build123d import export_step

    export_step(part, str(path))
    return path


# --- sources ---------------------------------------------------------------------------------------------------


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


# --- ABC-NEF ---------------------------------------------------------------------------------------------------


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


@pytest.mark.parametrize("layout", ["abc_nef", "emap"])
def test_both_layouts_of_abc_nef(bracket, tmp_path, layout):
    folder = abc_object(tmp_path / "data", bracket.views, layout)
    views, _ = run("abc_nef", folder, tmp_path)
    np.testing.assert_allclose(views.cameras.cam_from_unit, bracket.views.cameras.cam_from_unit, atol=1e-9)
    np.testing.assert_allclose(views.cameras.intrinsics, bracket.views.cameras.intrinsics)
    np.testing.assert_array_equal(views.world_from_unit, np.eye(4))
    assert (views.rgb == bracket.views.rgb).all()
    assert (views.edge_maps == bracket.views.alpha).all()
    rows = find_abc_nef(tmp_path / "data")
    assert [(row.name, row.source) for row in rows] == [("00000042", "abc_nef")]
    assert not has_truth("abc_nef", str(folder))


def test_truth_files_may_lie_elsewhere(tmp_path):
    folder = tmp_path / "data" / "7"
    folder.mkdir(parents=True)
    other = tmp_path / "truth" / "7"
    other.mkdir(parents=True)
    assert find_truth(folder, tmp_path / "truth") is None
    (other / "7_x_trimesh_001.obj").touch()
    (other / "7_x_features_001.yml").touch()
    assert find_truth(folder, tmp_path / "truth").mesh.name == "7_x_trimesh_001.obj"
    assert has_truth("abc_nef", str(folder), str(tmp_path / "truth"))
    assert has_truth("part", "cup")
    assert not has_truth("nerf", "folder")


@pytest.mark.shared
@pytest.mark.skipif(not NUT.is_dir(), reason="the published object is not here")
def test_the_published_nut(tmp_path):
    views, truth = run(
        "abc_nef", NUT, tmp_path, settings=ViewsSettings(view_count=8, truth_points=2000), with_truth=True
    )
    covered, seen = views.alpha >= 128, truth.face_ids >= 0
    assert (covered & seen).sum() / (covered | seen).sum() > 0.9999
    assert sorted(truth.face_types) == ["cone"] * 6 + ["cylinder"] + ["plane"] * 8
    assert (truth.edge_count, truth.vertex_count, len(truth.face_pairs)) == (32, 18, 32)
    assert len(truth.curve_types) == 32
    np.testing.assert_allclose(np.linalg.norm(truth.normals, axis=1), 1, atol=1e-6)


# --- bad input -------------------------------------------------------------------------------------------------


def refuse(match, source, path, folder, **arguments):
    with pytest.raises(InputError, match=match) as caught:
        run(source, path, folder, **arguments)
    assert caught.value.fix
    assert not (folder / "views.h5").exists()


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
