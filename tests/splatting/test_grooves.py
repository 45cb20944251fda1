"""Grooves in the walls of bores, against a drum whose groove is known."""

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images, open_grooves
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.volume import Volume
from build123d import Cylinder, Pos
from rendered import rendered

RADIUS, TALL, SIZE = 20.0, 18.0, 40.0  # of a drum, mm: it fills the unit frame
BORE = 10.0
CELLS = 128
UP = np.array([0, 0, 1.0])


def drum(middle: float, wide: float, deep: float):
    """A bored drum with a groove around its bore, about a height over its middle; `wide` along the bore."""
    part = Cylinder(RADIUS, TALL) - Cylinder(BORE, 30)
    return part - Pos(0, 0, middle) * Cylinder(BORE + deep, wide) if wide else part


def hull() -> Volume:
    """What silhouettes and the bore leave of it: no groove."""
    x, y, z = np.moveaxis(
        np.stack(np.meshgrid(*[np.arange(CELLS + 1) / CELLS] * 3, indexing="ij"), axis=-1) - 0.5, -1, 0
    )
    around = np.hypot(x, y)
    solid = np.minimum(np.minimum(RADIUS / SIZE - around, around - BORE / SIZE), TALL / SIZE / 2 - np.abs(z))
    return Volume(solid.astype(np.float32), np.zeros(3), 1 / CELLS)


def bore(way: np.ndarray) -> Prism:
    """The bore as it is known from one end."""
    pitch, count = 1 / 160, 121
    first, second = plane_axes(way)
    middle = np.full(3, 0.5) + TALL / SIZE / 2 * way
    rows, columns = np.mgrid[:count, :count]
    outline = np.hypot(rows - count // 2, columns - count // 2) * pitch < BORE / SIZE
    origin = middle - (first + second) * pitch * count / 2
    return Prism(Lattice(origin, first, second, way, pitch, (count, count)), outline, TALL / SIZE, True, 0.0)


def cut(views) -> np.ndarray:
    """(N, 3) places in mm that are emptied, from the drum's middle; the bore is known from either end."""
    before = hull()
    after = open_grooves(Images.of(views, 0.0), before, [bore(UP), bore(-UP)])
    gone = np.argwhere((before.field > 0) & (after.field <= 0))
    return (gone / CELLS - 0.5) * SIZE


@pytest.mark.parametrize(("middle", "wide", "deep"), [(2.5, 4.0, 2.0), (-1.0, 5.0, 3.0)])
def test_a_groove_in_a_bore_is_cut_between_its_rims_down_to_its_floor(tmp_path, middle, wide, deep):
    views, _ = rendered(tmp_path, drum(middle, wide, deep), 40, 500)
    gone = cut(views)
    assert len(gone)
    voxel = SIZE / CELLS
    low, high = gone[:, 2].min(), gone[:, 2].max()
    assert low == pytest.approx(middle - wide / 2, abs=2 * voxel)
    assert high == pytest.approx(middle + wide / 2, abs=2 * voxel)
    reach = np.linalg.norm(gone[:, :2], axis=1)
    assert reach.max() == pytest.approx(BORE + deep, abs=3 * voxel)
    turn = np.degrees(np.arctan2(gone[:, 1], gone[:, 0]))
    assert (np.histogram(turn, 36, (-180, 180))[0] > 0).all()  # all around


def test_a_smooth_bore_has_none(tmp_path):
    views, _ = rendered(tmp_path, drum(0.0, 0.0, 0.0), 40, 500)
    assert len(cut(views)) == 0
