"""Surfaces that an edge of something else has drawn away are held at their points."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.patches import Patch
from brepgaussian.brep.polish import _drawn
from brepgaussian.brep.refine import refine, refinement, solve
from brepgaussian.brep.refine.accept import Acceptance
from brepgaussian.brep.refine.parallax import Displaced
from brepgaussian.brep.refine.solve import Prior, State
from brepgaussian.geometry.surfaces import plane
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.splatting.parallax import Depths
from refine_support import start_of, surfaces_of, views_of


def verdict(area: float, face: int, px: float = 0.02) -> Acceptance:
    """A test by which one place of a face lies elsewhere, unless the area is none."""
    depths = Depths(
        np.array([[0, 0, 0, face]]), np.zeros((1, 3)), np.array([[0, 0, 1.0]]),
        np.array([3.0 if area else 0.0]), np.array([0.1]), np.array([True]),
    )  # fmt: skip
    areas = np.where(np.arange(6) == face, area, 0.0)
    return Acceptance(px, 0.9999, 0.0, False, displaced=Displaced(areas, depths))


def test_a_held_surface_is_trusted_more_than_its_neighbours():
    before = tuple(plane([0, 0, z], [0, 0, 1.0]) for z in (0.0, 0.5))
    now = tuple(replace(s, origin=s.origin + 0.001 * s.axis) for s in before)
    state, start = State(now, np.zeros(2), np.zeros((1, 3))), np.array([0, 3, 6])
    rows = [
        solve._fixed_rows(state, Prior(before, 0.01, 0.003, held), start, 8, [], False)
        for held in (frozenset(), frozenset({1}))
    ]
    (matrix, right), (held_matrix, held_right) = rows
    np.testing.assert_array_equal(matrix[:3], held_matrix[:3])
    np.testing.assert_array_equal(right[:3], held_right[:3])
    factor = np.diag(held_matrix)[3:6] / np.diag(matrix)[3:6]
    np.testing.assert_allclose(factor, factor[0])
    assert factor[0] > 100
    np.testing.assert_allclose(held_right[3:6], factor[0] * right[3:6])


@pytest.mark.parametrize(
    ("first", "second", "taken"),
    [
        (verdict(650, 2), verdict(0, 2), "held"),
        (verdict(650, 2), verdict(700, 2), "free"),  # its points were wrong
        (verdict(650, 2), verdict(0, 2, px=0.3), "free"),  # the images want it where it went
        (verdict(0, 2), None, "free"),  # nothing lies elsewhere
    ],
)
def test_what_strayed_is_solved_again_and_taken_if_it_is_better(tmp_path, monkeypatch, first, second, taken):
    from brepgaussian.views.truth import transformed
    from build123d import Box

    views = views_of(Box(60, 50, 40), tmp_path, rendered_views=8, image_size=200)
    solid = transformed(Box(60, 50, 40).wrapped, np.linalg.inv(views.world_from_unit))
    structure, mesh, moved, _ = start_of(solid, surfaces_of(solid), 3)
    calls = []

    def solved(start, settings, hopeless):
        calls.append(start.prior.held)
        name = "held" if start.prior.held else "free"
        state = replace(start.state, tone=np.array([0.5 if name == "held" else 0.25, 0.0]))
        test = second if name == "held" else first
        return refinement._Solved(replace(start, state=state), test, [], False)

    monkeypatch.setattr(refinement, "_solved", solved)
    monkeypatch.setattr(refinement, "sounded", lambda run, *rest: run)
    monkeypatch.setattr(refinement, "better", lambda after, before: True)
    result = refine(structure, mesh, moved, views, BrepSettings())
    assert calls[0] == frozenset()
    if second is not None:
        assert calls[1] == frozenset({structure.faces[2].surface})
    assert result.tone[0] == (0.5 if taken == "held" else 0.25)


@pytest.mark.parametrize("hope", [True, False])
def test_no_relations_are_sought_where_there_is_no_hope(tmp_path, monkeypatch, hope):
    from brepgaussian.views.truth import transformed
    from build123d import Box

    views = views_of(Box(60, 50, 40), tmp_path, rendered_views=8, image_size=200)
    solid = transformed(Box(60, 50, 40).wrapped, np.linalg.inv(views.world_from_unit))
    structure, mesh, moved, _ = start_of(solid, surfaces_of(solid), 3)
    asked, tried, descend = [], [], refinement.descend
    monkeypatch.setattr(refinement, "descend", lambda run, ties, *rest: tried.append(ties) or descend(run, ties, *rest))
    result = refine(
        structure,
        mesh,
        moved,
        views,
        BrepSettings(),
        hopeless=lambda test: asked.append(test.silhouette_px) or not hope,
    )
    assert len(asked) == 1
    assert asked[0] < 0.1  # told after edges were measured
    assert (len(tried) > 1) == hope
    assert bool(result.report["relations"]) == hope


@pytest.mark.parametrize(("off", "away", "left"), [(0.0, 0.025, True), (0.0, 0.015, False), (0.015, 0.04, False)])
def test_a_surface_has_left_its_points_if_it_explained_them_and_does_no_more(off, away, left):
    """Only a face's own: of a cap the points say nothing."""
    reach, xyz = 0.02, np.random.default_rng(0).random((200, 3)) * [1, 1, 0]
    surfaces = [plane([0, 0, off], [0, 0, 1.0])] * 3
    moved = [plane([0, 0, away], [0, 0, 1.0])] * 3
    patches = [Patch(s, k, xyz, xyz, reach, 0.001, cap=k == 1) for k, s in enumerate(surfaces)]
    structure = SimpleNamespace(faces=[SimpleNamespace(surface=0), SimpleNamespace(surface=1)])
    job, attempt, result = SimpleNamespace(patches=patches), SimpleNamespace(surfaces=surfaces), SimpleNamespace
    assert _drawn(job, structure, attempt, result(surfaces=moved)) == (frozenset({0}) if left else frozenset())
