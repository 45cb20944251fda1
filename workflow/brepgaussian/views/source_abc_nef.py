"""Source `abc_nef`: an object of ABC-NEF, in either published layout; its frame is the unit frame already."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from brepgaussian.artifacts.truth import Truth
from brepgaussian.artifacts.views import Views
from brepgaussian.errors import InputError
from brepgaussian.geometry.cameras import Cameras
from brepgaussian.log import get_logger
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.views.abc_nef_layout import ABC_NEF, EMAP, find_truth, is_abc_nef
from brepgaussian.views.checks import check_fit, check_intrinsics, check_pose
from brepgaussian.views.images import check_size, find_mask, read_image, read_json, read_rgba, resolve_image
from brepgaussian.views.poses import cam_from_world, opencv_from_opengl
from brepgaussian.views.source import Loaded, chosen_views

LOG = get_logger("views")
# Both layouts state the principal point for integer pixel indices.
PIXEL_CENTER = 0.5


@dataclass(frozen=True)
class _Frame:
    """One view as listed in the camera file."""

    image: Path
    edge_map: Path | None
    intrinsics: NDArray[np.float64]
    camera_to_world: NDArray[np.float64]  # OpenCV axes


def load_abc_nef(name: str, path: str, truth: str, want_truth: bool, settings: ViewsSettings, threads: int) -> Loaded:
    """Load an ABC-NEF object; `truth` is a second folder for the truth files, or empty."""
    folder = Path(path)
    if not folder.is_dir():
        raise InputError("is not a folder", file=folder, fix="give the object's folder")
    if not is_abc_nef(folder):
        raise InputError(
            f"holds neither {ABC_NEF} and train_img/ nor {EMAP} and color/",
            file=folder,
            fix="give the folder of one ABC-NEF object",
        )
    frames = _abc_nef_frames(folder) if (folder / ABC_NEF).is_file() else _emap_frames(folder)
    keep = chosen_views(len(frames), settings.view_count)
    views = _read(name, [frames[i] for i in keep], folder)
    if not want_truth:
        return Loaded(views, None)
    return Loaded(views, _truth(views, folder, truth, settings, threads))


def _abc_nef_frames(folder: Path) -> list[_Frame]:
    file = folder / ABC_NEF
    frames = []
    for entry in read_json(file)["frames"]:
        try:
            stem = Path(entry["file_path"]).name
            matrix, pose = entry["camera_intrinsics"], entry["transform_matrix"]
        except (KeyError, TypeError) as error:
            raise InputError(f"a frame lacks {error}", file=file, fix="use the data set's own file") from error
        frames.append(
            _Frame(
                image=resolve_image(folder / "train_img" / stem),
                edge_map=resolve_image(folder / "train" / stem),
                intrinsics=_intrinsics(matrix, file, stem),
                camera_to_world=opencv_from_opengl(_pose(pose, file, stem)),
            )
        )
    return frames


def _emap_frames(folder: Path) -> list[_Frame]:
    file = folder / EMAP
    frames = []
    for entry in read_json(file)["frames"]:
        try:
            image, matrix, pose = str(entry["rgb_path"]), entry["intrinsics"], entry["camtoworld"]
        except (KeyError, TypeError) as error:
            raise InputError(f"a frame lacks {error}", file=file, fix="use the data set's own file") from error
        maps = [folder / f"edge_{kind}" / (Path(image).stem + ".png") for kind in ("PidiNet", "DexiNed")]
        frames.append(
            _Frame(
                image=folder / "color" / image,
                edge_map=next((m for m in maps if m.is_file()), None),
                intrinsics=_intrinsics(matrix, file, image),
                camera_to_world=_pose(pose, file, image),
            )
        )
    return frames


def _intrinsics(matrix: object, file: Path, view: str) -> NDArray[np.float64]:
    k = _matrix(matrix, file, view)
    values = np.array([k[0, 0], k[1, 1], k[0, 2] + PIXEL_CENTER, k[1, 2] + PIXEL_CENTER])
    check_intrinsics(values, file, view)
    return values


def _pose(matrix: object, file: Path, view: str) -> NDArray[np.float64]:
    pose = _matrix(matrix, file, view)
    check_pose(pose, file, view)
    return pose


def _matrix(values: object, file: Path, view: str) -> NDArray[np.float64]:
    try:
        matrix = np.array(values, float)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if matrix.ndim != 2 or min(matrix.shape) < 3:
        raise InputError(f"{view}: a matrix of numbers is malformed", file=file, fix="export the cameras again")
    return matrix


def _read(name: str, frames: list[_Frame], folder: Path) -> Views:
    first = read_image(frames[0].image).shape
    height, width = first[0], first[1]
    rgba = np.zeros((len(frames), height, width, 4), np.uint8)
    edge_maps: NDArray[np.uint8] | None = np.zeros((len(frames), height, width), np.uint8)
    for i, frame in enumerate(frames):
        pixels = read_rgba(frame.image, find_mask(frame.image, folder))
        check_size(pixels, width, height, frame.image)
        rgba[i] = pixels
        if edge_maps is None or frame.edge_map is None or not frame.edge_map.is_file():
            edge_maps = None
            continue
        strokes = read_image(frame.edge_map)
        check_size(strokes, width, height, frame.edge_map)
        edge_maps[i] = strokes if strokes.ndim == 2 else strokes[:, :, :3].max(axis=2)
    cameras = Cameras(
        intrinsics=np.stack([frame.intrinsics for frame in frames]),
        cam_from_unit=np.stack([cam_from_world(frame.camera_to_world) for frame in frames]),
        width=width,
        height=height,
    )
    return Views(
        object_name=name,
        names=tuple(frame.image.name for frame in frames),
        rgb=rgba[..., :3],
        alpha=rgba[..., 3],
        cameras=cameras,
        world_from_unit=np.eye(4),
        unit="arbitrary",
        edge_maps=edge_maps,
    )


def _truth(views: Views, folder: Path, root: str, settings: ViewsSettings, threads: int) -> Truth | None:
    from brepgaussian.views.render import face_ids
    from brepgaussian.views.truth_abc import read_abc_truth

    files = find_truth(folder, root)
    if files is None:
        return None
    truth = read_abc_truth(files, settings)
    ids = face_ids(truth.mesh_vertices, truth.mesh_triangles, truth.triangle_face, views.cameras, threads)
    LOG.info("silhouettes of the truth and of the images: IoU %.5f", check_fit(views, ids, files.mesh))
    return replace(truth, face_ids=ids)
