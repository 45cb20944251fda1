"""Places between fillets and the sharp edges that they replace, against geometry by hand and solids of the kernel."""

import numpy as np
import pytest
from brepgaussian.artifacts.primitives import Primitive
from brepgaussian.brep.benchmark import truth_of
from brepgaussian.brep.blends import Blend, blended
from brepgaussian.brep.damage import damaged
from brepgaussian.brep.job import Job, Rung
from brepgaussian.brep.offcuts import offcuts
from brepgaussian.brep.patches import make_patches
from brepgaussian.brep.silhouettes import make_silhouettes
from brepgaussian.geometry.surfaces import cylinder, plane
from brepgaussian.primitives.stage import primitives_of
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.settings.primitives import PrimitivesSettings


@pytest.mark.parametrize("material", [True, False])
def test_places_beside_a_fillet_of_a_square_edge(kit, material):
    """In the square of one radius beside the edge, beyond the quarter of a circle, near the fillet's points."""
    radius, side = 0.2, 1.0 if material else -1.0
    walls = [plane(np.full(3, 0.5), side * np.eye(3)[0]), plane(np.full(3, 0.5), side * np.eye(3)[1])]
    centre = np.array([0.5 - radius, 0.5 - radius, 0.5])
    fillet = cylinder(centre, np.eye(3)[2], radius, flipped=not material)
    rng = np.random.default_rng(7)
    turn, height = rng.uniform(0, np.pi / 2, 400), rng.uniform(0.2, 0.4, 400)
    on = np.column_stack([centre[0] + radius * np.cos(turn), centre[1] + radius * np.sin(turn), height])
    clouds = [np.full((20, 3), 0.5) + 0.01 * rng.normal(size=(20, 3)) for _ in walls]
    xyz = np.concatenate([*clouds, on])
    label = np.repeat([0, 1, 2], [20, 20, 400])
    normals = np.concatenate([np.tile(w.axis, (20, 1)) for w in walls] + [fillet.normals(on)])
    items = [Primitive(s, i, np.flatnonzero(label == i), 0.0) for i, s in enumerate([*walls, fillet])]
    patches = make_patches(items, kit.make_points(xyz, normals, label), 0.05)
    (place,) = offcuts(patches, [Blend(2, (0, 1))], [0, 1])
    assert place.material == material
    assert place.owners == (0, 1)

    points = rng.uniform(0.2, 0.6, (5000, 3))
    points[:, 2] = rng.uniform(0.22, 0.38, 5000)
    near = np.hypot(*(points[:, :2] - centre[:2]).T) > radius
    inside = (points[:, :2] > centre[:2]).all(axis=1) & (points[:, :2] < 0.5).all(axis=1)
    np.testing.assert_array_equal(place.holds(points), near & inside)
    assert not place.holds(points + np.array([0, 0, 0.6])).any()  # beyond the fillet's ends
    corner = np.array([[0.5, 0.5, 0.3], [0.45, 0.5, 0.3]])
    assert place.holds(corner).all()  # on the faces, too


def rounded_case(wall):
    """A case whose vertical edges are rounded within and without: 15 faces."""
    from build123d import Pos, RectangleRounded, extrude

    outer, inner = RectangleRounded(100, 70, 9), RectangleRounded(100 - 2 * wall, 70 - 2 * wall, 4)
    return extrude(outer, 30) - Pos(0, 0, 5) * extrude(inner, 60)


@pytest.mark.parametrize(("wall", "seed", "without"), [(4, 3, False), (5, 4, False), (4, 3, True)])
def test_a_thin_case_with_rounded_corners(monkeypatch, wall, seed, without):
    """Its walls' planes cut the rounded corners into cells that silhouettes show as empty."""
    from brepgaussian.brep import assemble

    if without:  # what they are for
        monkeypatch.setattr(assemble, "offcuts", lambda *_: ())
    solid = rounded_case(wall)
    truth, views = truth_of(solid.wrapped, "case")
    points = damaged(truth, 0.001, 0.0, "none", seed)
    primitives = primitives_of(points, PrimitivesSettings())
    patches, blends = blended(make_patches(primitives.items, points, 0.05), primitives.sigma)
    assert sum(len(b.faces) == 2 for b in blends) == 8
    silhouettes = make_silhouettes(views.alpha, views.cameras, 16, 400)
    job = Job(tuple(patches), (), np.zeros((0, 3)), (), silhouettes, BrepSettings(), blends=blends)
    result = assemble.attempt(job, Rung("support", 0.04))
    assert (result.verdict.faces == len(truth.face_types) == 19) != without
    if not without:
        assert result.verdict.doubts == ()
        size = max(solid.bounding_box().size)
        assert result.verdict.volume * size**3 == pytest.approx(solid.volume, rel=0.01)
