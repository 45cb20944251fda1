"""What a hull has above confirmed faces: cut off where it is a bulge, kept where something stands there."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.faces import flatten
from brepgaussian.splatting.faces.confirm import Face
from ring import SIZE, ring_of_cameras


@pytest.mark.parametrize(("width", "high", "kept"), [(4, 0.15, True), (30, 0.15, False), (4, 0.05, False)])
def test_what_stands_on_a_face_keeps_its_foot_if_it_is_narrow_and_high(monkeypatch, width, high, kept):
    lattice = Lattice(np.zeros(3), *np.eye(3), 0.01, (100, 100))
    face = Face(lattice, np.ones((100, 100), bool), 0.002, 0.3)
    rows, columns = np.mgrid[2:98, 2:98].reshape(2, -1)
    above = np.column_stack([0.01 * (rows + 0.5), 0.01 * (columns + 0.5), np.full(rows.size, high)])
    foot = (rows >= 40) & (rows < 40 + width) & (columns < 70)
    # a bulge of twice the foot's samples: enough of it is needed for the face to be in doubt
    some = foot | (np.arange(rows.size) % 16 == 0)
    monkeypatch.setattr(flatten, "_needed", lambda views, samples, after: foot[some])
    found = flatten._allowed(None, face, above[some], 0.01, None)
    assert (found is not None) == kept
    if kept:
        assert not found.outline[40:44, 2:70].any()
        assert found.outline[:37].all()
        assert found.outline[:, 75:].all()


def test_a_face_on_which_nothing_needed_stands_is_left_alone(monkeypatch):
    face = Face(Lattice(np.zeros(3), *np.eye(3), 0.01, (100, 100)), np.ones((100, 100), bool), 0.002, 0.3)
    above = np.array([[0.5, 0.5, 0.1], [0.3, 0.3, 0.1]])
    monkeypatch.setattr(flatten, "_needed", lambda views, samples, after: np.zeros(len(samples), bool))
    assert flatten._allowed(None, face, above, 0.01, None) is face
    assert flatten._allowed(None, face, above[:0], 0.01, None) is face


def test_silhouettes_tell_a_bulge_from_a_rib():
    cameras = ring_of_cameras()
    base = trimesh.creation.box(bounds=[[0.2, 0.2, 0.3], [0.8, 0.8, 0.5]])
    rib = trimesh.creation.box(bounds=[[0.45, 0.2, 0.5], [0.5, 0.8, 0.7]])
    hull = trimesh.creation.box(bounds=[[0.4, 0.2, 0.5], [0.55, 0.8, 0.7]])
    part = trimesh.util.concatenate([base, rib])
    scene = Scene(part.vertices, part.faces)
    alpha = np.zeros((len(cameras), SIZE, SIZE), np.uint8)
    rows, columns = np.mgrid[:SIZE, :SIZE] + 0.5
    for view in range(len(cameras)):
        center, rays = cameras.rays(view, np.column_stack([columns.ravel(), rows.ravel()]))
        alpha[view] = 255 * scene.occluded(np.broadcast_to(center, rays.shape), rays).reshape(SIZE, SIZE)
    views = SimpleNamespace(cameras=cameras, alpha=alpha)
    lattice = Lattice(np.array([0.2, 0.2, 0.5]), *np.eye(3), 0.01, (60, 60))
    beside, all_over = np.ones((60, 60), bool), np.ones((60, 60), bool)
    beside[25:30] = False  # where the rib stands
    samples = hull.sample(20000, seed=0)
    face = Face(lattice, beside, 0.0, 0.2)
    assert flatten._allowed(views, face, samples, 0.02, scene) is face
    without = Scene(base.vertices, base.faces)
    assert flatten._allowed(views, Face(lattice, all_over, 0.0, 0.2), samples, 0.02, without) is None


@pytest.mark.parametrize(
    ("bulge", "said", "kept"),
    [
        (0.2, (0.4, 1.2, 500), False),  # walls went with it
        (0.2, (1.0, 0.4, 500), True),
        (0.2, (0.4, 1.2, 20), True),  # hardly a ray tells
        (0.01, (0.4, 1.2, 500), True),  # too low to be judged
    ],
)
def test_views_judge_high_bulges(monkeypatch, bulge, said, kept):
    monkeypatch.setattr(flatten, "disagreements", lambda *_: said)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 51)] * 3, indexing="ij"), axis=-1)
    hull = Volume((0.3 - np.abs(grid - 0.5).max(axis=-1)).astype(np.float32), np.zeros(3), 0.02)
    lattice = Lattice(np.array([0.3, 0.3, 0.6]), *np.eye(3), 0.02, (20, 20))
    face = Face(lattice, np.ones((20, 20), bool), 0.001, bulge)
    assert flatten._agreeable(None, face, hull, hull.scene(), flatten._bare(face, hull)) == kept


@pytest.mark.parametrize("high", [0.2, 0.01])
@pytest.mark.parametrize(
    ("side", "said", "kept"),
    [
        (8, (0.4, 1.2, 500), False),  # a wall went with it
        (8, (0.0, 0.0, 0), False),  # nobody sees there
        (8, (1.0, 0.4, 500), True),
        (2, (1.0, 0.4, 500), False),  # too small to be asked about
    ],
)
def test_a_face_keeps_no_spot_of_its_own_under_what_stands_beside_it(monkeypatch, side, said, kept, high):
    monkeypatch.setattr(flatten, "disagreements", lambda *_: said)
    x, y, z = np.moveaxis(np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1), -1, 0)
    base = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.4 - np.abs(y - 0.5), 0.2 - np.abs(z - 0.3)])
    boss = np.minimum.reduce([0.12 - np.hypot(x - 0.5, y - 0.5), 0.5 + high - z, z - 0.3])
    hull = Volume(np.maximum(base, boss).astype(np.float32), np.zeros(3), 0.01)
    lattice = Lattice(np.array([0.1, 0.1, 0.5]), *np.eye(3), 0.01, (80, 80))
    middle = np.linalg.norm(lattice.centers()[..., :2] - 0.5, axis=-1)
    spot = np.abs(lattice.centers()[..., :2] - 0.5).max(axis=-1) < side * 0.01 / 2
    face = Face(lattice, (middle > 0.14) | spot, 0.001, 0.2)
    left = flatten._without_spots(None, face, hull, hull.scene(), np.zeros((80, 80), int)).outline
    np.testing.assert_array_equal(left, (middle > 0.14) | (spot if kept or high < 0.02 else False))


@pytest.mark.parametrize(("said", "kept"), [((0.4, 1.2, 500), False), ((0, 0, 0), False), ((1.0, 0.4, 500), True)])
def test_a_wall_ends_at_a_rib_whose_edge_is_a_face_unless_views_tell(monkeypatch, said, kept):
    """A region may take the rib's side for the wall that it stands against; what is below its edge is asked alone."""
    monkeypatch.setattr(flatten, "disagreements", lambda *_: said)
    x, y, z = np.moveaxis(np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1), -1, 0)
    base = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.4 - np.abs(y - 0.5), 0.1 - np.abs(z - 0.2)])
    rib = np.minimum.reduce([y - 0.8, 0.9 - y, z - 0.1, x - 0.1, (1.0 - x - z) / np.sqrt(2)])
    hull = Volume(np.maximum(base, rib).astype(np.float32), np.zeros(3), 0.01)
    wall = Lattice(np.array([0.1, 0.1, 0.3]), *np.eye(3), 0.01, (80, 80))
    face = Face(wall, np.ones((80, 80), bool), 0.001, 0.6)
    slanted = np.array([[1, 0, -1], [0, 1, 0], [1, 0, 1]]) / np.array([[np.sqrt(2)], [1], [np.sqrt(2)]])
    edge = Lattice(np.array([0.1, 0.8, 0.9]), *slanted, 0.01, (84, 10))
    others = [face, Face(edge, np.ones((84, 10), bool), 0.001, 0.0)]
    below = 2 * flatten._below(face, others, 0.01)
    left = flatten._without_spots(None, face, hull, hull.scene(), below).outline
    foot = np.zeros((80, 80), bool)
    foot[1:56, 70:] = True  # x < .66: as high as tells
    np.testing.assert_array_equal(left[:, :69], True)
    assert (left[foot].mean() > 0.98) if kept else (left[foot].mean() < 0.02)


def test_the_other_side_of_a_groove_stands_when_a_face_is_cleared():
    """A shaft beyond a relief groove lies over the flange's face, and is no bulge of it."""
    spacing, grid = 0.01, np.stack(np.meshgrid(*[np.linspace(0, 1, 101)] * 3, indexing="ij"), axis=-1)
    away, height = np.hypot(grid[..., 0] - 0.5, grid[..., 1] - 0.5), grid[..., 2]

    def cylinder(radius: float, low: float, high: float):
        return np.minimum(radius - away, np.minimum(height - low, high - height))

    bulge = cylinder(0.3, 0.3, 0.34)  # what a hull has beside the groove
    field = np.max([cylinder(0.4, 0.1, 0.3), cylinder(0.15, 0.3, 0.36), cylinder(0.2, 0.36, 0.9), bulge], axis=0)
    hull = Volume(field.astype(np.float32), np.zeros(3), spacing)
    lattice = Lattice(np.array([0.0, 0.0, 0.3]), *np.eye(3), spacing, (100, 100))
    middles = lattice.centers()
    radius = np.hypot(middles[..., 0] - 0.5, middles[..., 1] - 0.5)
    face = Face(lattice, (radius > 0.16) & (radius < 0.39), 0.0, 0.06)
    cut = flatten._carve(hull, [face])
    angles = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    around = np.column_stack([np.cos(angles), np.sin(angles)])

    def at(radius: float, height: float):
        return np.column_stack([0.5 + radius * around, np.full(len(around), height)])

    assert hull.inside(at(0.25, 0.32)).all()
    assert not cut.inside(at(0.25, 0.32)).any()
    assert cut.inside(at(0.18, 0.38)).all()


def test_a_face_all_of_which_something_stands_on_clears_nothing():
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, 41)] * 3, indexing="ij"), axis=-1)
    field = 0.4 - np.abs(grid - 0.5).max(axis=-1)
    hull = Volume(field.astype(np.float32), np.zeros(3), 0.025)
    lattice = Lattice(np.array([0.25, 0.25, 0.3]), *np.eye(3), 0.025, (20, 20))
    face = Face(lattice, np.ones((20, 20), bool), 0.0, 0.1)  # within the block
    np.testing.assert_array_equal(flatten._carve(hull, [face]).field, hull.field)
