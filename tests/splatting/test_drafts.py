"""A pocket whose walls lean all the way down is no countersunk one: the simpler shape comes first."""

import numpy as np
import pytest
from brepgaussian.splatting.concave import Images
from brepgaussian.splatting.concave.depth import measured
from brepgaussian.splatting.concave.openings import rectify
from brepgaussian.splatting.concave.planes import PITCH_PIXELS
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.volume import Volume
from build123d import Align, Box, Pos, RectangleRounded, extrude
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)
DEEP, LONG, WIDE, CELLS = 10.0, 36.0, 26.0, 96


@pytest.mark.parametrize("degrees", [5, 8])
def test_a_drafted_pocket_is_tapered_down_to_its_floor(tmp_path, degrees):
    part = Box(50, 40, 16, align=LOW) - Pos(0, 0, 16) * extrude(RectangleRounded(LONG, WIDE, 6), -DEEP, taper=degrees)
    views, _ = rendered(tmp_path, part, 50, 600)
    size, middle = views.world_from_unit[0, 0], np.linalg.inv(views.world_from_unit) @ [0, 0, 8, 1]
    half = np.array([25, 20, 8]) / size
    grid = np.stack(np.meshgrid(*[np.arange(CELLS + 1) / CELLS] * 3, indexing="ij"), axis=-1)
    block = (half - np.abs(grid - middle[:3])).min(axis=-1).astype(np.float32)
    hull, images = Volume(block, np.zeros(3), 1 / CELLS).scene(), Images.of(views, 0.0)
    pitch = PITCH_PIXELS * views.cameras.footprint()
    cells = np.ceil(2 * half[:2] / pitch).astype(int) - 4
    corner = middle[:3] + np.append(-cells * pitch / 2, half[2])
    lattice = Lattice(corner, *np.eye(3), pitch, (int(cells[0]), int(cells[1])))
    place = np.abs(lattice.centers()[..., :2] - middle[:2]) * size
    outline = (place < [LONG / 2, WIDE / 2]).all(axis=-1)
    prism, _ = measured(images, hull, rectify(images, hull, lattice), outline)
    assert not np.isfinite(prism.sink)
    assert prism.draft == pytest.approx(np.tan(np.radians(degrees)), abs=0.03)
    assert prism.depth * size == pytest.approx(DEEP, rel=0.03)
