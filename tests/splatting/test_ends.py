"""Faces behind a hole whose floor no ray tells: analytic slabs, the far side of which may lean."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.ends import _behind, core_of, ring_of
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.volume import Volume

SPACING, PITCH = 0.01, 0.005
TOP, THICK = 0.7, 0.25


def drilled(lean: float, depth: float) -> tuple[Volume, Prism]:
    """A slab whose far side is THICK below the middle of its top, rising by `lean` along x, and a hole from its top."""
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1)
    far = TOP - THICK + lean * (grid[..., 0] - 0.5)
    field = np.minimum(TOP - grid[..., 2], (grid[..., 2] - far) / np.hypot(1, lean))
    sides = np.minimum(grid[..., :2], 1 - grid[..., :2]).min(axis=-1) - 0.05
    lattice = Lattice(np.array([0.3, 0.3, TOP]), *np.eye(3), PITCH, (80, 80))
    cells = np.stack(np.meshgrid(*[np.arange(80) - 39.5] * 2, indexing="ij"), axis=-1)
    prism = Prism(lattice, np.hypot(*np.moveaxis(cells, -1, 0)) < 10, depth, False, 0.0, endless=True)
    solid = Volume(np.minimum(field, sides).astype(np.float32), np.zeros(3), SPACING)
    return solid.without(prism, 2 * SPACING), prism


@pytest.mark.parametrize("lean", [0.0, 0.35, -0.6])
def test_the_nearest_face_behind_a_hole_is_found_though_it_leans(lean):
    hull, prism = drilled(lean, 0.08)
    far, pierced = _behind(hull.scene(), prism, core_of(prism), ring_of(prism), nearest=True)
    assert far is not None
    assert not pierced
    depths, normal = far.at(prism, prism.outline)
    x = prism.lattice.centers()[prism.outline][:, 0]
    assert np.abs(depths - (THICK - lean * (x - 0.5))).max() < SPACING / 2
    assert normal @ (np.array([lean, 0.0, -1.0]) / np.hypot(1, lean)) > 0.999
    assert far.deepest(prism) == pytest.approx(depths.max())


def test_the_farthest_face_is_parallel_to_the_mouth():
    leaning, level = (drilled(lean, 0.08) for lean in (0.6, 0.0))
    assert _behind(leaning[0].scene(), leaning[1], core_of(leaning[1]), ring_of(leaning[1]), nearest=False)[0] is None
    far, _ = _behind(level[0].scene(), level[1], core_of(level[1]), ring_of(level[1]), nearest=False)
    assert far is not None
    assert far.depth == pytest.approx(THICK, abs=SPACING / 2)
