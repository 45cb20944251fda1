"""Concavities: the geometry of a prism, and pockets of a rendered part that every silhouette is blind to."""

import numpy as np
import pytest
from brepgaussian.artifacts.truth import read_truth
from brepgaussian.artifacts.views import read_views
from brepgaussian.settings.views import ViewsSettings
from brepgaussian.splatting.concave import Prism
from brepgaussian.splatting.concave.openings import Stack, openings
from brepgaussian.splatting.concave.prism import Lattice
from brepgaussian.splatting.concave.scene import Scene
from brepgaussian.splatting.hull import carve
from brepgaussian.views.stage import make_views


def box_prism(through=False):
    """An opening of 0.2 x 0.1 in the plane z = 0.5, 0.3 deep."""
    lattice = Lattice(np.array([0.3, 0.3, 0.5]), *np.eye(3), 0.01, (40, 30))
    outline = np.zeros((40, 30), bool)
    outline[10:30, 10:20] = True
    return Prism(lattice, outline, 0.3, through, 0.0)


def test_signed_distance_of_a_prism_is_that_of_its_box():
    prism = box_prism()
    points = np.random.default_rng(3).uniform([0.25, 0.25, 0.1], [0.75, 0.65, 0.6], (500, 3))
    low, high = np.array([0.4, 0.4, 0.2]), np.array([0.6, 0.5, 0.52])  # reaches .02 above the opening
    inside = ((points > low) & (points < high)).all(axis=1)
    clear = np.abs(np.concatenate([points - low, points - high], axis=1)).min(axis=1) > 0.006  # half a cell
    assert np.array_equal((prism.signed_distance(points, 0.02) < 0)[clear], inside[clear])
    assert prism.area == pytest.approx(0.02)


def test_a_prism_that_goes_through_is_open_at_its_end():
    below = np.array([[0.5, 0.45, 0.19]])
    assert box_prism().signed_distance(below, 0.02)[0] > 0
    assert box_prism(through=True).signed_distance(below, 0.02)[0] < 0


@pytest.mark.parametrize(("interreflection", "bound"), [(0.0, 0.02), (0.9, 0.01)])
def test_blind_pockets_are_opened_down_to_their_floors(tmp_path, interreflection, bound):
    settings = ViewsSettings(rendered_views=30, image_size=400, interreflection=interreflection)
    files = {"out_views": tmp_path / "views.h5", "out_truth": tmp_path / "truth.h5"}
    make_views(object_name="plate", source="part", path="pocket_plate:5", settings=settings, **files)
    views, truth = read_views(files["out_views"]), read_truth(files["out_truth"])
    planes = [f for f, kind in enumerate(truth.face_types) if kind == "plane"]
    normal = np.array([0.0, 0.0, 1.0])
    up = [f for f in planes if (truth.normals[truth.point_face == f] @ normal).mean() > 0.99]
    heights = {f: truth.points[truth.point_face == f][:, 2].mean() for f in up}
    floors = np.isin(truth.point_face, [f for f in up if heights[f] < max(heights.values()) - 0.01])

    def distance(concavities):
        hull, _ = carve(views, 96, 1, concavities)
        scene = Scene(hull.vertices, hull.triangles)
        return float(np.mean(np.abs(scene.signed_distance(truth.points[floors]))))

    assert floors.any()
    assert distance(False) > 0.04
    assert distance(True) < bound


def test_a_ring_shaped_opening_keeps_its_island():
    rows, columns = np.mgrid[:120, :110]
    radius = np.hypot(rows - 60, columns - 55)
    ring = (radius > 20) & (radius < 40)
    shown = np.zeros((20, 120, 110), np.uint8)  # the lid's grey
    shown[::3, ring] = 1  # a third of the views see something else
    stack = Stack(
        Lattice(np.zeros(3), *np.eye(3), 0.005, ring.shape),
        np.ones(ring.shape, bool),
        shown,
        shown * 1.0,
        np.zeros(ring.shape),
    )
    found = openings(stack, 0.001)
    overlap = [(o & ring).sum() / (o | ring).sum() for o in found]
    assert max(overlap) > 0.9
    assert any(o[60, 55] for o in found)  # the disc is a hypothesis as well
