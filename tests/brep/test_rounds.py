"""Fillets proposed beside places that parallax puts elsewhere."""

from dataclasses import replace

import numpy as np
import pytest
from brep_support import patches_of
from brepgaussian.brep.budget import Budget
from brepgaussian.brep.features import WIDTHS
from brepgaussian.brep.job import Attempt, Job, Rung
from brepgaussian.brep.polish import Polished
from brepgaussian.brep.rounds import _surface, fillets, inner_fillets, roundings
from brepgaussian.brep.simplify import Change
from brepgaussian.brep.structure import Edge, Face, Structure
from brepgaussian.brep.trials import Trials
from brepgaussian.brep.verdict import Verdict
from brepgaussian.geometry.rolling import touching
from brepgaussian.geometry.surfaces import cone, cylinder, plane, surface_to_row
from brepgaussian.settings.brep import BrepSettings

X, Y, UP = np.eye(3)


def pocket():
    """The four walls of a square pocket, whose normals look inwards, and its four corners as edges."""
    rng = np.random.default_rng(0)
    surfaces, clouds, edges = [], [], []
    for normal in (X, Y, -X, -Y):
        across = np.cross(UP, normal)
        surfaces.append(plane(0.5 - 0.3 * normal, normal))
        clouds.append(
            0.5 - 0.3 * normal + rng.uniform(-0.3, 0.3, (2000, 1)) * across + rng.uniform(-0.2, 0.2, (2000, 1)) * UP
        )
    for k in range(4):
        corner = 0.5 - 0.3 * (surfaces[k].axis + surfaces[(k + 1) % 4].axis)
        line = corner + np.linspace(-0.2, 0.2, 40)[:, None] * UP
        pair = (k, (k + 1) % 4)
        edges.append(Edge(pair, pair, "line", line, "concave", (2 * k, 2 * k + 1), (0.0, 0.4), False))
    return Structure((), tuple(edges), ()), surfaces, patches_of(surfaces, clouds)


def beside(edge, surfaces, away, depth):
    """Places beside the middle of an edge, on its first face."""
    first, second = (surfaces[s] for s in edge.surfaces)
    at = edge.polyline[len(edge.polyline) // 2] + away * second.axis
    return np.array([[*first.project(at[None])[0], depth]] * 3)


def test_all_corners_of_a_pocket_get_the_fillet_that_one_shows():
    structure, surfaces, patches = pocket()
    found = fillets(structure, surfaces, patches, beside(structure.edges[0], surfaces, 0.02, -1.0))
    assert len(found) == len(WIDTHS)
    assert sorted({c.new[-1].surface.radius for c in found}) == sorted(WIDTHS)
    assert found[0].new[-1].surface.radius < max(WIDTHS)  # the size that the places speak for comes first
    for change in found:
        walls, bands = change.new[:4], change.new[4:]
        assert len(bands) == 4
        for edge, band in zip(structure.edges, bands, strict=True):
            round_ = band.surface
            assert round_.flipped  # a concave fillet
            for s in edge.surfaces:
                axis_away = (round_.origin - surfaces[s].origin) @ surfaces[s].axis
                np.testing.assert_allclose(axis_away, round_.radius, atol=1e-12)
                assert (surfaces[s].signed_distance(band.xyz) > -1e-12).all()  # before both walls
                assert (surfaces[s].signed_distance(band.xyz) < round_.radius).all()
        assert all(len(w.xyz) < len(p.xyz) for w, p in zip(walls, patches, strict=True))


def test_a_floor_and_a_bore_get_a_torus():
    rng, turn = np.random.default_rng(1), np.linspace(0, 2 * np.pi, 120)
    surfaces = [cylinder(np.full(3, 0.5), UP, 0.3, flipped=True), plane(np.array([0.5, 0.5, 0.3]), UP)]
    angle, rho = rng.uniform(0, 2 * np.pi, 3000), 0.3 * np.sqrt(rng.random(3000))
    wall = np.column_stack([0.3 * np.cos(angle), 0.3 * np.sin(angle), rng.uniform(-0.2, 0.3, 3000)]) + 0.5
    floor = np.column_stack([0.5 + rho * np.cos(angle), 0.5 + rho * np.sin(angle), np.full(3000, 0.3)])
    line = np.column_stack([0.5 + 0.3 * np.cos(turn), 0.5 + 0.3 * np.sin(turn), np.full(120, 0.3)])
    structure = Structure((), (Edge((0, 1), (0, 1), "circle", line, "concave", (0, 0), (0, 2 * np.pi), True),), ())
    off = np.array([[0.78, 0.5, 0.3, -0.8]])
    for change in fillets(structure, surfaces, patches_of(surfaces, [wall, floor]), off):
        made = change.new[-1].surface
        assert made.kind == "torus"
        np.testing.assert_allclose([made.radius + made.minor, made.origin[2] - made.minor], [0.3, 0.3], atol=1e-12)
        assert np.abs(made.signed_distance(change.new[-1].xyz)).max() < 1e-12


@pytest.mark.parametrize(("away", "depth"), [(0.02, 1.0), (0.2, -1.0)])
def test_without_a_reason_there_is_no_fillet(away, depth):
    """A concave edge's faces that should lie deeper, and places far from every edge, speak for none."""
    structure, surfaces, patches = pocket()
    assert fillets(structure, surfaces, patches, beside(structure.edges[0], surfaces, away, depth)) == []
    assert fillets(structure, surfaces, patches, np.zeros((0, 4))) == []


@pytest.mark.parametrize(("px", "proposed"), [(0.1, False), (0.8, True), (None, True)])
def test_a_convex_edge_that_images_confirm_gets_no_fillet(px, proposed):
    _, surfaces, patches = pocket()
    ridge = [replace(s, axis=-s.axis) for s in surfaces]
    structure = Structure((), tuple(replace(e, convexity="convex") for e in pocket()[0].edges), ())
    off = beside(structure.edges[0], surfaces, 0.02, 1.0)
    rows = [{"name": f"edge {k}", "silhouette_px": None, "interior_px": px} for k in range(4)]
    assert bool(fillets(structure, ridge, patches, off, rows)) is proposed


@pytest.mark.parametrize(("px", "corners"), [((0.9, 0.05, 0.05, 0.05), (0,)), ((0.25,) * 4, ()), ((0.9,) * 4, ())])
def test_a_concave_edge_that_images_show_elsewhere_gets_a_fillet(px, corners):
    """Where all edges are shown elsewhere, it is not for fillets."""
    structure, surfaces, patches = pocket()
    rows = [{"name": f"edge {k}", "silhouette_px": None, "interior_px": px[k]} for k in range(4)]
    found = inner_fillets(structure, surfaces, patches, rows)
    assert [c.new[-1].surface.radius for c in found] == (list(WIDTHS) if corners else [])
    for change in found:
        bands = [p for p in change.new if p.surface.kind == "cylinder"]
        assert len(bands) == len(corners)
        for corner, band in zip(corners, bands, strict=True):
            walls = [surfaces[s] for s in structure.edges[corner].surfaces]
            assert [w.signed_distance(band.surface.origin[None])[0] for w in walls] == pytest.approx(
                [band.surface.radius] * 2
            )
    convex = replace(structure, edges=tuple(replace(e, convexity="convex") for e in structure.edges))
    assert inner_fillets(convex, surfaces, patches, rows) == []


@pytest.mark.parametrize(
    ("seen", "shown", "told"), [(500, 0, True), (500, 20, True), (500, 200, False), (90, 0, False)]
)
def test_an_edge_at_which_views_show_no_step_is_for_fillets(seen, shown, told):
    """A fillet at a boss's foot, large enough that the step lies out of reach of the search for it."""
    structure, surfaces, patches = pocket()
    rows = [
        {"name": f"edge {k}", "silhouette_px": None, "interior_px": 0.02, "creases": 500, "interior": 450}
        for k in range(4)
    ]
    rows[1] |= {"interior_px": None, "creases": seen, "interior": shown}
    found = inner_fillets(structure, surfaces, patches, rows)
    assert [c.new[-1].surface.radius for c in found] == (list(WIDTHS) if told else [])


@pytest.mark.parametrize("hole", [False, True])
def test_a_cone_and_a_plane_across_it_have_a_fillet(hole):
    wall, floor = cone(np.full(3, 0.5), -UP, 0.2, 0.2, hole), plane(np.full(3, 0.5), UP)
    found = _surface((floor, wall), -0.03)
    np.testing.assert_array_equal(surface_to_row(found), surface_to_row(touching(wall, floor, -0.03)))
    assert _surface((floor, cone(np.full(3, 0.5), X, 0.2, 0.2, hole)), -0.03) is None  # not across


def test_fillets_that_a_solid_has_tell_the_radius_of_others():
    structure, surfaces, patches = pocket()
    rows = [{"name": f"edge {k}", "silhouette_px": None, "interior_px": 0.9 if k == 0 else 0.02} for k in range(4)]
    round_ = cylinder(np.full(3, 0.5), UP, 0.071, flipped=True)
    faces = tuple(Face(k, 0.1, np.zeros(3)) for k in range(5))
    seam = replace(structure.edges[1], faces=(1, 4), surfaces=(1, 4), convexity="smooth")
    known = Structure(faces, (*structure.edges, seam), ())
    found = inner_fillets(known, [*surfaces, round_], patches, rows)
    assert [c.new[-1].surface.radius for c in found] == [0.071, 0.03, 0.015]  # one of .06 comes out the same


def test_caps_that_a_solid_does_not_use_do_not_stop_the_search():
    """The surfaces of a rebuilt solid are those of the patches and of the caps in use only."""
    _, surfaces, patches = pocket()
    job = Job(tuple(patches), tuple(patches[:2]), np.zeros((0, 3)), (), None, BrepSettings())
    moved = tuple(plane(s.origin + 1e-3 * s.axis, s.axis) for s in surfaces)
    best = Polished(Attempt("caps", None, Verdict(()), moved), {})
    trials = Trials(None, None, job, Rung("caps", 0.04, caps=True), best, Budget(1, 1))
    found = trials._refined()
    assert [p.surface for p in found.patches] == list(moved)
    assert found.caps == job.caps


@pytest.mark.parametrize("accepted", [True, False])
def test_walls_are_mended_from_the_surfaces_that_images_have_refined(monkeypatch, accepted):
    """From the points' own surfaces the solid around a chamfer that bends, a slot say, may not come out again."""
    _, surfaces, patches = pocket()
    rng = np.random.default_rng(0)
    bent = np.column_stack([0.05 * rng.random(400), rng.random(400), np.zeros(400)])
    arc = cylinder(np.array([0.025, 0, -0.5]), np.array([0, 1.0, 0]), 0.5)
    bulge = patches_of([arc], [arc.project(bent)])
    job = Job((*patches, *bulge), (), np.zeros((0, 3)), (), None, BrepSettings())
    moved = tuple(plane(s.origin + 1e-3 * s.axis, s.axis) for s in surfaces)
    attempt = Attempt("support", None, Verdict((), structure=Structure((), (), ())), (*moved, arc))
    report = {"accepted": accepted, "refinement": {"edges": []}}
    trials = Trials(None, None, job, Rung("support", 0.04), Polished(attempt, report), Budget(9, 9))
    tried = []

    def refuse(changes, **_):
        tried.extend((c.name, [p.surface.kind for p in c.new]) for c in changes)
        assert [p.surface for p in trials.job.patches] == [*moved, arc]

    monkeypatch.setattr(trials, "_tried", refuse)
    trials._mended()
    assert (f"patch {bulge[0].primitive} unbent", ["plane"]) in tried or accepted
    assert not (tried and accepted)


@pytest.mark.parametrize("degrees", [90.0, 120.0])
def test_a_refused_edge_between_planes_is_rounded_as_far_back_as_a_chamfer(degrees):
    """Two faces that meet at a convex edge along z, and a rim that gets its chamfer beside."""
    turn = np.radians(degrees)
    normals = X, np.array([np.cos(np.pi - turn), np.sin(np.pi - turn), 0])
    surfaces = [plane(np.zeros(3), n) for n in normals]
    share = np.random.default_rng(2).random((3000, 3))
    along = [np.cross(UP, n) for n in normals]
    clouds = [share[:, :1] * s * 0.5 * a + share[:, 1:2] * UP for s, a in zip((-1, 1), along, strict=True)]
    line = np.linspace(0, 1, 80)[:, None] * UP
    edge = Edge((0, 1), (0, 1), "line", line, "convex", (0, 1), (0.0, 1.0), False)
    rows = [{"name": "edge 0", "silhouette_px": 3.0, "interior_px": None}]
    found = roundings(Structure((), (edge,), ()), surfaces, patches_of(surfaces, clouds), rows)
    assert len(found) == len(WIDTHS)
    for width, change in zip(WIDTHS, found, strict=True):
        made = change.new[-1]
        assert made.surface.kind == "cylinder"
        assert not made.surface.flipped
        for face in surfaces:
            assert face.signed_distance(made.surface.origin[None])[0] == pytest.approx(-made.surface.radius)
            assert (face.signed_distance(made.xyz) < 1e-12).all()  # behind both faces
        if degrees == 90.0:
            back = np.sqrt(2) * made.surface.radius - made.surface.radius
            assert back == pytest.approx(width / np.sqrt(2))  # as a chamfer with legs of that width
    assert (
        roundings(
            Structure((), (edge,), ()), surfaces, patches_of(surfaces, clouds), [rows[0] | {"silhouette_px": 0.05}]
        )
        == []
    )


def test_corners_of_another_radius_are_proposed_from_the_solid_that_has_the_first(monkeypatch):
    """A change names patches by their place, and a change that is taken moves them."""
    _, surfaces, patches = pocket()
    job = Job(tuple(patches), (), np.zeros((0, 3)), (), None, BrepSettings())
    attempt = Attempt("support", None, Verdict((), structure=Structure((), (), ())), tuple(surfaces))
    trials = Trials(None, None, job, Rung("support", 0.04), Polished(attempt, {"accepted": True}), Budget(9, 9))
    asked, tried = [], []

    def propose(structure, surfaces, patches):
        asked.append(len(patches))
        return [Change(f"{len(asked)}{k}", (), ()) for k in "ab"] if len(asked) < 3 else []

    def take(changes, **_):
        tried.extend(change.name for change in changes)
        trials.job = replace(trials.job, patches=trials.job.patches[:-1])
        return True

    monkeypatch.setattr("brepgaussian.brep.trials.completed", propose)
    monkeypatch.setattr(trials, "_tried", take)
    trials._completed()
    assert tried == ["1a", "2a"]
    assert asked == [4, 3, 2]
