"""Bent bores: where two round openings meet, how a bend is shaped, and that only a pipe of one thickness has one."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.splatting.concave import bends
from brepgaussian.splatting.concave.bends import Bend, Elbow, bent, cut, elbow_of
from brepgaussian.splatting.concave.prism import Lattice, Prism, plane_axes
from brepgaussian.splatting.concave.sections import Rounded, Section
from brepgaussian.splatting.concave.volume import Volume
from brepgaussian.splatting.concave.walls import Walls

PITCH, SIZE, VOXEL = 0.005, 60, 0.01
BORE, PIPE, BEND = 0.08, 0.13, 0.3
CORNER = np.array([0.75, 0.5, 0.75])


def mouth(direction, distance, radius=BORE, **changes):
    """A round blind opening whose axis passes the corner, some distance from it."""
    normal = np.asarray(direction, float) / np.linalg.norm(direction)
    first, second = plane_axes(normal)
    center = (SIZE - 1) / 2
    origin = CORNER + distance * normal - (center + 0.5) * PITCH * (first + second)
    cells = radius / PITCH
    section = Section((center, center), 0.0, Rounded((cells, cells), cells))
    outline = section.signed_distance(np.stack(np.indices((SIZE, SIZE)), axis=-1).astype(float)) < 0
    lattice = Lattice(origin, first, second, normal, PITCH, outline.shape)
    return replace(Prism(lattice, outline, 0.35, False, 0.05, section=section), **changes)


def ends(turn=90.0):
    """Mouths .6 and .5 from the corner of a bore that turns by some degrees: down, and aside."""
    angle = np.radians(turn)
    return [mouth([0, 0, -1.0], 0.6), mouth([-np.sin(angle), 0, np.cos(angle)], 0.5)]


@pytest.mark.parametrize("turn", [35.0, 90.0, 120.0])
def test_axes_of_two_mouths_meet_in_the_corner(turn):
    elbow = elbow_of(*ends(turn))
    np.testing.assert_allclose(elbow.corner, CORNER, atol=1e-9)
    np.testing.assert_allclose(elbow.straight, [0.6, 0.5], atol=1e-9)
    assert elbow.radius == pytest.approx(BORE)
    bend = elbow.bend(BEND * elbow.slope)
    assert bend.bend == pytest.approx(BEND)
    axis = bend.axis()
    for place, direction in ((axis[0], elbow.first), (axis[-1], elbow.second)):  # the axis runs into the straight ones
        np.testing.assert_allclose(place, CORNER + BEND * elbow.slope * direction, atol=1e-9)
    chords = np.diff(axis, axis=0) / np.linalg.norm(np.diff(axis, axis=0), axis=1, keepdims=True)
    assert chords[0] @ -elbow.first > 0.99
    assert chords[-1] @ elbow.second > 0.99


@pytest.mark.parametrize(
    "other",
    [
        mouth([0, 0, 1.0], 0.5),  # straight on
        mouth([-1.0, 0, 0], 0.5, radius=0.1),
        mouth([-1.0, 0, 0], 0.5, through=True),
        mouth([-1.0, 0, 0], 0.5, section=None),
        mouth([-1.0, 0, 0], 0.5, draft=0.1),
        mouth([-1.0, 0, 0], -0.5),  # opens into the other
    ],
)
def test_other_openings_are_no_elbow(other):
    assert elbow_of(ends()[0], other) is None
    aside = ends()[1]
    moved = replace(aside, lattice=replace(aside.lattice, origin=aside.lattice.origin + np.array([0, 0.05, 0])))
    assert elbow_of(ends()[0], moved) is None


def test_distance_from_a_bend_is_that_from_its_axis():
    bend = elbow_of(*ends()).bend(BEND)
    turn = np.linspace(0, np.pi / 2, 2000)[:, None]
    axis = bend.center + BEND * (np.cos(turn) * -bend.second + np.sin(turn) * -bend.first)
    points = np.random.default_rng(0).uniform(0.2, 0.9, (500, 3))
    within = ((points - bend.center) @ np.stack([bend.first, bend.second], axis=1) < 0).all(axis=1)
    expected = np.linalg.norm(points[within, None] - axis, axis=2).min(axis=1) - BORE
    np.testing.assert_allclose(bend.wall(points[within])[0], expected, atol=1e-5)
    assert ((bend.signed_distance(points[within], 0.0) < 0) == (expected < 0)).all()
    assert (bend.signed_distance(points[~within], 0.0) > 0).all()


def pipe(thick=PIPE):
    """A solid pipe along a bent axis; with `thick` None a block about it."""
    steps = np.arange(0.0, 1.0001, VOXEL)
    nodes = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), axis=-1).reshape(-1, 3)
    if thick is None:
        outside = np.abs(nodes - 0.5).max(axis=1) - 0.45
    else:
        whole = Bend(*_ring(), BEND, thick)
        ways = ((whole.first, 0.3), (whole.second, 0.2))
        straight = [_rod(nodes, CORNER + BEND * way, way, thick, length) for way, length in ways]
        outside = np.minimum(whole.signed_distance(nodes, 0.0), np.minimum(*straight))
    return Volume(-outside.reshape((len(steps),) * 3).astype(np.float32), np.zeros(3), VOXEL)


def _ring():
    bend = Elbow(CORNER, *(e.lattice.normal for e in ends()), (0.6, 0.5), BORE).bend(BEND)
    return bend.center, bend.normal, bend.first, bend.second


def _rod(nodes, start, way, radius, length):
    offset = nodes - start
    along = offset @ way
    ends = np.maximum(-along - VOXEL, along - length)
    return np.maximum(np.linalg.norm(offset - along[:, None] * way, axis=1) - radius, ends)


class Silent:
    """Rays that tell nothing; or are against what comes."""

    def __init__(self, against):
        self.against = against

    def hitting(self, scene, at):
        floor = CORNER - np.array([0, 0, 0.25])  # of the first blind hole
        assert at(np.array([floor, [0.05, 0.05, 0.05]])).tolist() == [True, False]
        return self

    def costs(self, scene):
        return scene

    def advantage(self, costs, other):
        return self.against


@pytest.mark.parametrize(("thick", "against", "found"), [(PIPE, 0.0, 1), (PIPE, 9.0, 0), (None, 0.0, 0)])
def test_a_pipe_tells_how_its_bore_bends_and_a_block_does_not(monkeypatch, thick, against, found):
    monkeypatch.setattr(bends, "rays_at_object", lambda _: Silent(against))
    hull, blind = pipe(thick), ends()
    straight, bend = bent(None, hull, blind, 0.02)
    assert len(bend) == found
    if not found:
        assert straight == blind
        return
    assert bend[0].bend == pytest.approx(BEND, abs=VOXEL)
    assert [p.depth for p in straight] == pytest.approx([0.3, 0.2], abs=VOXEL)
    opened = cut(hull, bend[0]).scene()
    assert (opened.signed_distance(bend[0].axis()[3:-3]) > 0.9 * BORE).all()  # empty along the axis


def test_surfels_on_a_bend_lie_on_one_wall():
    bend = elbow_of(*ends()).bend(BEND)
    rng = np.random.default_rng(1)
    turn, around = rng.uniform(0.1, 1.4, 300), rng.uniform(0, 2 * np.pi, 300)
    ring = np.cos(turn)[:, None] * -bend.second + np.sin(turn)[:, None] * -bend.first
    out = np.cos(around)[:, None] * ring + np.sin(around)[:, None] * bend.normal
    wall = bend.center + BEND * ring + BORE * out
    found = Walls([], VOXEL, [bend]).under(wall + rng.normal(0, 0.002, (300, 1)) * out, -out)
    assert len(np.unique(found.piece)) == 1
    assert found.piece[0] >= 0
    np.testing.assert_allclose(found.foot, wall, atol=1e-9)
    np.testing.assert_allclose(found.normal, -out, atol=1e-9)
    assert (Walls([], VOXEL, [bend]).under(wall, out).piece == -1).all()  # they face into the solid
