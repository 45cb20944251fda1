"""A screw's hole through both halves of a split clamp, up to its counterbore; and a blind pocket over a hole."""

import numpy as np
import pytest
from brepgaussian.splatting.concave.onward import _is_pierced
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.hull import carve
from build123d import Align, Box, Cylinder, Pos
from rendered import rendered

LOW = (Align.CENTER, Align.CENTER, Align.MIN)


@pytest.mark.parametrize("goes_on", [True, False])
def test_a_hole_goes_on_behind_a_gap_if_the_floor_there_is_open(tmp_path, goes_on):
    clamp = Box(46, 26, 32, align=LOW) - Pos(8, 0, 14) * Box(40, 60, 4, align=LOW)
    clamp -= Pos(12, 0, 0) * Cylinder(3.5, 80 if goes_on else 32)
    clamp -= Pos(12, 0, 27) * Cylinder(6, 10, align=LOW)
    views, truth = rendered(tmp_path, clamp, 40)
    hull, _ = carve(views, 128, concavities=True)
    solid, found = Scene(truth.mesh_vertices, truth.mesh_triangles), Scene(hull.vertices, hull.triangles)
    # down the middle of the upper half's hole
    middle = (np.array([12, 0, 22.5]) - [0, 0, 16]) / 46 + 0.5
    points = middle + np.random.default_rng(0).uniform(-0.04, 0.04, (200, 3))
    assert ((solid.signed_distance(points) > 0) == goes_on).all()
    assert ((found.signed_distance(points) > 0) == goes_on).mean() > 0.95


@pytest.mark.parametrize(("radius", "pierced"), [(0.0, False), (0.02, True)])
def test_what_silhouettes_left_behind_a_gap_tells_that_a_hole_goes_on(radius, pierced):
    """A block with a gap across z .45 to .55, a hole down to that, and a narrower one on to z = .3, or none."""
    x, y, z = np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij")
    aside = np.hypot(x - 0.5, y - 0.5)
    block = np.minimum(0.4 - np.abs(np.stack([x, y, z]) - 0.5).max(axis=0), np.abs(z - 0.5) - 0.05)
    hole, pocket = np.maximum(aside - 0.06, 0.5 - z), np.maximum(aside - 0.1, z - 0.3)
    field = np.minimum.reduce([block, hole, pocket, np.maximum(aside - radius, z - 0.5)])
    cells = np.hypot(*np.indices((30, 30)) - 14.5)
    lattice = Lattice(np.array([0.425, 0.425, 0.9]), *np.eye(3), 0.005, (30, 30))
    prism = Prism(lattice, cells < 12, 0.38, True, 0.0)
    scene = Volume(field.astype(np.float32), np.zeros(3), 0.01).scene()
    assert _is_pierced(scene, prism, 0.6) == pierced
