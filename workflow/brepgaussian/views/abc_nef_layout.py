"""Where the files of an ABC-NEF object lie, in either published layout. Light: no images are read here.

ABC-NEF: `<id>/train_img/*.png` (RGBA), `<id>/train/*.png` (edge maps), `<id>/transforms_train.json`.
EMAP: `<id>/color/*.png`, `<id>/edge_PidiNet/`, `<id>/edge_DexiNed/`, `<id>/meta_data.json`.
Truth: `*_trimesh_*.obj` and `*_features_*.yml`, beside the images or under `<truth root>/<id>`, or in the
truth root itself with the id as the start of their names.
"""

from dataclasses import dataclass
from pathlib import Path

from brepgaussian.errors import InputError
from brepgaussian.project.objects import ObjectRow

ABC_NEF, EMAP = "transforms_train.json", "meta_data.json"


@dataclass(frozen=True)
class TruthFiles:
    """Mesh and feature list of an ABC model."""

    mesh: Path
    features: Path


def is_abc_nef(folder: Path) -> bool:
    """Whether a folder holds an object in one of the layouts."""
    return ((folder / ABC_NEF).is_file() and (folder / "train_img").is_dir()) or (
        (folder / EMAP).is_file() and (folder / "color").is_dir()
    )


def seems_abc_nef(folder: Path) -> bool:
    """Whether a folder holds at least a part of an object, so that a broken one is told of, not passed over."""
    parts = (folder / ABC_NEF, folder / EMAP, folder / "train_img", folder / "color")
    return any(part.exists() for part in parts)


def find_abc_nef(root: str | Path, truth_root: str | Path = "") -> list[ObjectRow]:
    """All objects under a root folder (at most two levels down), sorted by name.

    Args:
        root: the folder of the data set, or one object's folder.
        truth_root: folder of the truth files if they don't lie beside the images.

    Raises:
        InputError: the folder is missing or holds no object.
    """
    root = Path(root)
    if not root.is_dir():
        raise InputError("is not a folder", file=root, fix="set `abc_nef: root:` to the folder of the data set")
    candidates = [root, *sorted(root.glob("*")), *sorted(root.glob("*/*"))]
    folders = [folder for folder in candidates if folder.is_dir() and seems_abc_nef(folder)]
    if not folders:
        raise InputError(
            f"holds no object with {ABC_NEF} and train_img/, or {EMAP} and color/",
            file=root,
            fix="point it at the folder that holds the objects' folders",
        )
    rows: dict[str, ObjectRow] = {}
    for folder in folders:
        row = ObjectRow(folder.name, "abc_nef", str(folder), str(truth_root or ""))
        if row.name in rows:
            raise InputError(f"holds two objects called {row.name}", file=root, fix="give one layout's folder only")
        rows[row.name] = row
    return [rows[name] for name in sorted(rows)]


def find_truth(folder: Path, truth_root: str | Path = "") -> TruthFiles | None:
    """The truth files of an object, or None if there are none."""
    name = folder.name
    places = [(folder, "")]
    if truth_root:
        places += [(Path(truth_root) / name, ""), (Path(truth_root), name)]
    for place, start in places:
        meshes = sorted(place.glob(f"{start}*trimesh*.obj"))
        features = sorted(place.glob(f"{start}*features*.yml")) + sorted(place.glob(f"{start}*features*.yaml"))
        if meshes and features:
            return TruthFiles(meshes[0], features[0])
    return None


def has_truth(source: str, path: str, truth: str = "") -> bool:
    """Whether a truth is known, cheaply: by the source and the presence of files."""
    if source in ("part", "step"):
        return True
    if source == "abc_nef":
        return find_truth(Path(path), truth) is not None
    return bool(truth)
