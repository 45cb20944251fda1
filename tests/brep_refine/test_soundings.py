"""Depths as observations of surfaces."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.brep.refine import descent
from brepgaussian.brep.refine.parameters import COUNT, update
from brepgaussian.brep.refine.soundings import Soundings
from brepgaussian.brep.structure import Face, Structure
from brepgaussian.geometry.surfaces import plane
from brepgaussian.settings.brep import BrepSettings
from brepgaussian.splatting.parallax import Depths
from refine_support import random_surface, surfaces_of, views_of

FOOTPRINT = 0.002


def solved(soundings, surface, rounds=8):
    """A surface moved to where soundings alone want it."""
    start, delta = np.array([0, COUNT[surface.kind]]), np.zeros(COUNT[surface.kind])
    for _ in range(rounds):
        matrix, right = soundings.normal([surface], start, start[1], np.zeros(start[1]))
        for _ in range(4):
            delta = np.linalg.solve(matrix + 1e-6 * np.eye(len(matrix)), right)
            matrix, right = soundings.normal([surface], start, start[1], delta)
        surface = update(surface, delta)
    return surface


@pytest.mark.parametrize("kind", ["plane", "cylinder", "cone", "sphere", "torus"])
@pytest.mark.parametrize("seed", [11, 12])
def test_a_surface_goes_through_its_soundings_but_for_wrong_ones(kind, seed):
    rng = np.random.default_rng(seed)
    truth = random_surface(kind, rng)
    points = truth.project(truth.origin + rng.uniform(-0.3, 0.3, (600, 3)))
    start = update(truth, 0.004 * rng.uniform(-1, 1, COUNT[kind]))
    wrong = points + np.where(rng.random((600, 1)) < 0.05, 0.05, 0.0) * truth.normals(points)
    result = solved(Soundings(np.zeros(600, np.int64), wrong, np.full(600, 1e-4), np.full(600, 1e-9)), start)
    assert np.abs(start.signed_distance(points)).max() > 1e-3
    assert np.abs(result.signed_distance(points)).max() < 2e-6


def test_places_move_along_their_normals_by_what_the_depth_says():
    depths = Depths(
        np.array([[0, 0, 0, 0], [1, 0, 0, 0], [2, 0, 0, 1]]),
        np.full((3, 3), 0.5),
        np.array([[0, 0, 1.0]] * 3),
        np.array([2.0, -1.0, 3.0]),
        np.full(3, 0.1),
        np.array([True, True, False]),
    )
    faces = tuple(Face(s, 1.0, np.zeros(3)) for s in (4, 2))
    found = Soundings.of(depths, Structure(faces, (), ()), FOOTPRINT)
    np.testing.assert_array_equal(found.surface, [4, 4])
    np.testing.assert_allclose(found.points[:, 2], [0.5 - 2 * FOOTPRINT, 0.5 + FOOTPRINT])
    np.testing.assert_allclose(found.sigma, 0.1 * FOOTPRINT)


def test_many_soundings_are_no_surer_than_what_they_have_in_common():
    points = np.column_stack([np.random.default_rng(0).random((5000, 2)), np.full(5000, 0.5)])
    bias = 3e-4
    soundings = Soundings(np.zeros(5000, np.int64), points, np.full(5000, 1e-4), np.full(5000, bias))
    matrix, _ = soundings.normal([plane(np.full(3, 0.5), [0, 0, 1.0])], np.array([0, 3]), 3, np.zeros(3))
    assert matrix[2, 2] ** -0.5 == pytest.approx(bias, rel=1e-3)


@pytest.mark.parametrize(("ratio", "rounds"), [(0.5, 5), (0.95, 2), (2.0, 2)])
def test_depths_are_told_again_while_that_settles(monkeypatch, ratio, rounds):
    told = []

    class Moving(SimpleNamespace):
        def displaced(self):
            return SimpleNamespace(depths=None)

    def descend(run, ties, windows, free, places):
        told.append(run.at)
        step = 0.003 * ratio ** len(told)
        return Moving(**vars(run) | {"at": run.at + step, "mesh": run.at + step}), None

    monkeypatch.setattr(descent, "descend", descend)
    monkeypatch.setattr(descent, "largest_move", lambda before, after: after - before)
    monkeypatch.setattr(descent.Soundings, "of", lambda *_: None)
    cameras = SimpleNamespace(footprint=lambda: FOOTPRINT)
    run = Moving(at=0.0, mesh=0.0, structure=None, views=SimpleNamespace(cameras=cameras))
    descent.sounded(run, run.displaced(), [], False)
    assert len(told) == rounds  # .003 / 2^5 is below .0001, or the second move is no smaller


def test_a_conical_pocket_is_mended_by_parallax(tmp_path):
    """Its rim is right and no view shows its floor's edge against the background: only its greys tell its angle."""
    from brepgaussian.brep.refine import from_solid, refine
    from brepgaussian.brep.structure import extract
    from brepgaussian.views.truth import transformed
    from build123d import Align, Box, Cone, Pos

    def block(bottom):
        return Box(60, 60, 40, align=(Align.CENTER, Align.CENTER, Align.MIN)) - Pos(0, 0, 27) * Cone(bottom, 22, 26)

    views = views_of(block(14), tmp_path)
    truth, start = (transformed(block(b).wrapped, np.linalg.inv(views.world_from_unit)) for b in (14, 13.4))
    surfaces = surfaces_of(start)
    structure, mesh = extract(start, surfaces), from_solid(start)
    result = refine(structure, mesh, surfaces, views, BrepSettings())
    wanted = next(s for s in surfaces_of(truth) if s.kind == "cone")
    index = next(k for k, s in enumerate(surfaces) if s.kind == "cone")
    before, after = (np.degrees(abs(abs(s.angle) - wanted.angle)) for s in (surfaces[index], result.surfaces[index]))

    assert after < before / 3
