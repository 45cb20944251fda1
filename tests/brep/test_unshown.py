"""Faces that no image shows, and fillets of hardly any radius, are proposed to be left out, others are not."""

import numpy as np
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.structure import CONCAVE, CONVEX, SMOOTH, Edge, Face, Structure
from brepgaussian.brep.unshown import shrunk, unshown
from brepgaussian.geometry.surfaces import cylinder, plane

LINE = np.zeros((2, 3))


def edge(first, second, convexity=CONVEX):
    return Edge((first, second), (first, second), "line", LINE, convexity, (0, 1), (0.0, 1.0), False)


def row(index, silhouette=None, interior=None):
    return {"name": f"edge {index}", "silhouette_px": silhouette, "interior_px": interior, "interior": 9}


def patch(primitive, count):
    xyz = np.zeros((count, 3))
    return Patch(plane(np.zeros(3), np.eye(3)[2]), primitive, xyz, xyz + np.eye(3)[2], 0.01, 0.001)


def case(rows, counts=(1000, 1000, 30), edges=None):
    edges = edges or (edge(0, 1), edge(0, 2, CONCAVE), edge(1, 2, CONCAVE))
    structure = Structure(tuple(Face(k, 1.0, np.zeros(3)) for k in range(3)), tuple(edges), ())
    return unshown(structure, [patch(10 + k, n) for k, n in enumerate(counts)], rows)


def test_a_small_face_without_a_shown_edge_is_proposed_with_its_points():
    (found,) = case([row(0, 0.02), row(1), row(2, None, 3.0)])
    assert found.gone == (2,)
    assert found.new == ()
    assert found.excused == 30 / 2030
    assert "patch 12" in found.name


def test_several_are_proposed_together_first():
    """The walls and the floor of a nook that is none."""
    edges = (edge(0, 1), edge(0, 2, CONCAVE), edge(1, 3, CONCAVE), edge(2, 3, CONCAVE))
    structure = Structure(tuple(Face(k, 1.0, np.zeros(3)) for k in range(4)), edges, ())
    patches = [patch(10 + k, n) for k, n in enumerate((1000, 1000, 30, 20))]
    both, first, second = unshown(structure, patches, [row(0, 0.02), row(1), row(2), row(3, None, 3.0)])
    assert (both.gone, first.gone, second.gone) == ((2, 3), (2,), (3,))
    assert both.excused == first.excused + second.excused
    assert "12, 13" in both.name


def test_a_silhouette_or_a_step_of_luminance_shows_a_face():
    assert case([row(0, 0.02), row(1, 0.05), row(2)]) == []
    assert case([row(0, 0.02), row(1), row(2, None, 0.2)]) == []


def test_a_large_face_and_one_with_smooth_edges_only_stay():
    assert case([row(0, 0.02), row(1), row(2)], counts=(1000, 1000, 300)) == []
    smooth = (edge(0, 1), edge(0, 2, SMOOTH), edge(1, 2, SMOOTH))
    assert case([row(0, 0.02), row(1), row(2)], edges=smooth) == []


def test_a_wall_between_two_fillets_stays(monkeypatch):
    rows = [row(0, 0.02), row(1), row(2, None, 3.0)]
    assert len(case(rows)) == 1
    monkeypatch.setattr("brepgaussian.brep.unshown.between_fillets", lambda index, _: index == 2)
    assert case(rows) == []


PIXEL = 0.003
UP = np.eye(3)[2]


def fillets(radii, convexity=SMOOTH, counts=(1000, 1000, 30, 20)):
    """What is proposed for a wall, a floor and fillets of some radii between them."""
    surfaces = [plane(np.zeros(3), UP), plane(np.zeros(3), UP), *(cylinder(np.zeros(3), UP, r, True) for r in radii)]
    edges = [edge(k, wall, convexity) for k in range(2, len(surfaces)) for wall in (0, 1)]
    structure = Structure(tuple(Face(k, 1.0, np.zeros(3)) for k in range(len(surfaces))), tuple(edges), ())
    patches = [patch(10 + k, n) for k, n in zip(range(len(surfaces)), counts, strict=False)]
    return shrunk(structure, surfaces, patches, PIXEL)


def test_fillets_that_no_image_could_show_are_proposed_together_and_alone():
    both, first, second = fillets([0.003, 0.009])
    assert (both.gone, first.gone, second.gone) == ((2, 3), (2,), (3,))
    assert both.faint
    assert both.excused == 50 / 2050
    assert [c.gone for c in fillets([0.003, 0.02])] == [(2,)]


def test_fillets_that_images_show_large_ones_and_bores_stay():
    assert fillets([0.012, 0.05]) == []
    assert fillets([0.003, 0.003], counts=(1000, 1000, 300, 300)) == []
    assert fillets([0.003, 0.003], convexity=CONCAVE) == []  # a pin or a hole, whose edges are sharp
