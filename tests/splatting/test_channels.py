"""Channels straightened by their sections, holes as wide all along; on solids made by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from brepgaussian.splatting.concave import sweep, widening
from brepgaussian.splatting.concave.columns import Cut, cuts, holes
from brepgaussian.splatting.concave.contours import Chords
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.sweep import _filling
from brepgaussian.splatting.concave.volume import Volume

SPACING = 1 / 100
GRID = np.stack(np.meshgrid(*[SPACING * np.arange(101)] * 3, indexing="ij"), axis=-1)
UP = np.array([0, 0, 1.0])


def block_with_slot(rise):
    """A block with a slot along x, .2 wide and .2 deep at its ends, whose floor rises inwards; a bore along y below."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.3 - np.abs(z - 0.5)])
    floor = 0.6 + rise * np.minimum(x - 0.1, 0.9 - x)
    slot = np.minimum(0.1 - np.abs(y - 0.5), z - floor)
    bore = 0.12 - np.hypot(x - 0.5, z - 0.55)
    return Volume(np.minimum.reduce([block, -slot, -bore]).astype(np.float32), np.zeros(3), SPACING)


@pytest.mark.parametrize("rise", [0.1, 0.3])
def test_a_channel_is_told_from_a_bore_across_it_by_its_ends(rise):
    ends = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=0.4 + s * 0.5) for s in (1.0, -1.0)]
    hull = block_with_slot(rise)
    found = cuts(hull, np.array([1.0, 0, 0]), ends)
    (slot,) = [c for c in found if c.at_ends]
    within = np.array([[0.5, 0.5, 0.63], [0.3, 0.43, 0.65], [0.7, 0.57, 0.69]])
    beside = np.array([[0.5, 0.3, 0.55], [0.5, 0.7, 0.55], [0.5, 0.5, 0.57], [0.3, 0.37, 0.65], [0.5, 0.5, 0.45]])
    (prism,) = slot.prisms
    assert (hull.without(prism, 0.0).scene().signed_distance(within) > 0).all()
    assert (prism.signed_distance(beside, 0.0) > 0).all()
    somewhere = [c for c in found if not c.at_ends]
    assert all((c.prisms[0].signed_distance(beside, 0.0) < 0).any() for c in somewhere)  # they take the bore along


@pytest.mark.parametrize("told", [False, True])
def test_what_nothing_tells_of_is_not_cut_along_with_a_channel(monkeypatch, told):
    """Columns that are empty somewhere take a bore along; what shows the ends of a slot speaks for it alone."""
    ends = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=0.4 + s * 0.5) for s in (1.0, -1.0)]
    hull = block_with_slot(0.1)
    found = cuts(hull, np.array([1.0, 0, 0]), ends)
    (somewhere,) = [c for c in found if not c.at_ends]
    opened = hull.without(somewhere.prisms[0], 0.0)

    def disagreements(images, before, after, reach):
        rest = not (before.signed_distance(np.array([[0.3, 0.5, 0.61]])) < 0).any()  # the slot is open before
        return (1.0, 0.2, 500 if told else 0) if rest else (1.0, 0.2, 500)

    monkeypatch.setattr(sweep, "disagreements", disagreements)
    monkeypatch.setattr(sweep, "one_surface", lambda *_: 0.0)
    less = sweep._shown_at_ends(None, hull, somewhere, opened, found)
    assert (less is None) == told
    if less is not None:
        left = less[0].scene().signed_distance(np.array([[0.3, 0.5, 0.61], [0.3, 0.5, 0.5]]))
        assert left[0] > 0  # in the slot
        assert left[1] < 0  # beside the bore


@pytest.mark.parametrize(("deep", "rays", "ends"), [(0.28, 500, True), (0.28, 30, False), (0.4, 500, False)])
def test_a_bore_with_a_narrower_end_is_not_carried_along(monkeypatch, deep, rays, ends):
    """Silhouettes see through it, and leave a funnel that is as wide as the bore at its mouth."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.4 - np.abs(y - 0.5), 0.2 - np.abs(z - 0.5)])
    hull = Volume(block.astype(np.float32), np.zeros(3), SPACING)
    on = Lattice(np.array([0.3, 0.3, 0.7]), *np.eye(3), SPACING, (40, 40))
    prism = Prism(on, np.linalg.norm(on.centers()[..., :2] - 0.5, axis=-1) < 0.15, 0.4, False, 0.0)
    axis = np.column_stack([np.full((80, 2), 0.5), np.linspace(0.305, 0.695, 80)])
    true = axis[:, 2] > 0.7 - deep

    def disagreements(images, before, after, reach):
        wrong = [float(((scene.signed_distance(axis) > 0) != true).mean()) for scene in (before, after)]
        return (*wrong, rays)

    monkeypatch.setattr(sweep, "disagreements", disagreements)
    opened = hull.without(prism, 0.0)
    assert sweep._ends_before(None, hull, Cut((prism,), 100.0, False), opened) == ends


def test_of_several_channels_what_no_ray_tells_of_is_not_cut(monkeypatch):
    """Rays that look into a slot do not speak for what lies between a recess and a slot on the other side."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.4 - np.abs(x - 0.5), 0.4 - np.abs(y - 0.5), 0.2 - np.abs(z - 0.5)])
    hull = Volume(block.astype(np.float32), np.zeros(3), SPACING)

    def column(middle):
        lattice = Lattice(np.array([middle - 0.1, 0.4, 0.7]), *np.eye(3), SPACING, (20, 20))
        return Prism(lattice, np.ones((20, 20), bool), 0.4, False, 0.0)

    shown, hidden = column(0.3), column(0.7)
    cut = Cut((shown, hidden), 2e4, True)

    def disagreements(images, before, after, reach):
        inside = np.array([[0.3, 0.5, 0.5]])
        looked_at = before.signed_distance(inside)[0] < 0 < after.signed_distance(inside)[0]
        return (1.0, 0.3, 500) if looked_at else (0.0, 0.0, 0)

    monkeypatch.setattr(sweep, "disagreements", disagreements)
    monkeypatch.setattr(sweep, "one_surface", lambda *_: 0.0)
    opened = hull.without(shown, 0.0).without(hidden, 0.0)
    less, volume, good = sweep._told(None, hull, cut, opened)
    assert good
    assert less.prisms == (shown,)
    places = volume.scene().signed_distance(np.array([[0.3, 0.5, 0.5], [0.7, 0.5, 0.5]]))
    assert places[0] > 0 > places[1]
    monkeypatch.setattr(sweep, "disagreements", lambda *_: (0.0, 0.0, 0))
    assert not sweep._told(None, hull, cut, opened)[2]


@pytest.mark.parametrize("seed", range(4))
def test_samples_in_a_prism_are_those_that_it_contains(seed):
    rng = np.random.default_rng(seed)
    axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    lattice = Lattice(rng.uniform(0.3, 0.6, 3), *axes, 0.02, (25, 18))
    prism = Prism(lattice, rng.random((25, 18)) < 0.6, rng.uniform(0.05, 0.3), False, 0.0)
    ends = rng.uniform(0, 1, (2, 500, 3))
    chords = Chords(np.arange(500), *ends)
    expected = prism.contains(chords.samples(), 0.01)
    assert expected.any()
    assert (chords.within(prism, 0.01) == expected).all()


@pytest.mark.parametrize(("brim", "deep", "kept"), [(0.02, False, True), (0.02, True, False), (0.0, False, True)])
def test_a_section_loses_the_brim_that_silhouettes_need(brim, deep, kept):
    """A slot's section .2 wide, with a brim on either side: rays along the brim have nothing else in their way."""
    outline = np.zeros((100, 60), bool)
    outline[40:60, 30:60] = True  # y, z
    wide = outline.copy()
    wide[round(40 - 100 * brim) : round(60 + 100 * brim), 55:60] = True
    lattice = Lattice(
        np.array([0.9, 0, 0]), np.array([0, 1.0, 0]), np.array([0, 0, 1.0]), np.array([1.0, 0, 0]), 0.01, wide.shape
    )
    y = np.array([0.385, 0.615, *np.linspace(0.42, 0.58, 90)])
    entry = np.column_stack([np.full(92, 0.2), y, np.full(92, 0.575)])
    if deep:
        entry[:40, 1], entry[:40, 2] = 0.5, 0.45
    only = np.arange(92) < (40 if deep else 2)  # the others have something below the slot in their way, too
    chords = Chords(
        np.arange(92),
        entry,
        entry + np.where(only, 0.6, 0.9)[:, None] * [1, 0, 0] + np.where(only, 0, -0.5)[:, None] * UP,
    )
    cut = Cut((Prism(lattice, wide, 0.8, False, 0.0),), 1e4, True)
    found = _filling(chords, cut)
    assert (found is not None) == kept
    if found is not None and brim:
        left = found.prisms[0].outline
        assert not left[:39].any()
        assert not left[61:].any()
        assert (left & outline).sum() > 0.95 * outline.sum()


def test_a_channel_goes_on_past_a_slot_across_it():
    x = GRID[..., 0]
    hull = block_with_slot(0.1)
    hull = hull.with_field(
        np.minimum(hull.field, np.maximum(np.abs(x - 0.5) - 0.08, 0.45 - GRID[..., 2])).astype(np.float32)
    )
    walls = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=-0.08 + s * 0.5) for s in (1.0, -1.0)]
    ends = [SimpleNamespace(normal=np.array([s, 0, 0.0]), offset=0.4 + s * 0.5) for s in (1.0, -1.0)]
    whole = [c for c in cuts(hull, np.array([1.0, 0, 0]), walls + ends) if c.prisms[0].depth > 0.7]
    within = np.array([[0.15, 0.5, 0.63], [0.3, 0.43, 0.64], [0.7, 0.57, 0.63], [0.85, 0.5, 0.63]])
    beside = np.array([[0.3, 0.5, 0.57], [0.7, 0.65, 0.65], [0.2, 0.35, 0.65]])
    assert any(
        (c.prisms[0].signed_distance(within, 0.0) < 0).all() and (c.prisms[0].signed_distance(beside, 0.0) > 0).all()
        for c in whole
    )
    assert all(c.at_ends for c in whole)  # what is empty somewhere in it may be the slot across


def narrowing_bore(radius=0.1, least=0.06):
    """A block with an upright bore that silhouettes leave too narrow in the middle, and a dent in its side."""
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.3 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.4 - np.abs(z - 0.5)])
    wide = np.maximum(radius - (radius - least) * np.maximum(1 - np.abs(z - 0.5) / 0.3, 0), least)
    bore = wide - np.hypot(x - 0.5, y - 0.5)
    dent = 0.1 - np.linalg.norm(GRID - [0.8, 0.5, 0.5], axis=-1)
    return Volume(np.minimum.reduce([block, -bore, -dent]).astype(np.float32), np.zeros(3), SPACING)


@pytest.mark.parametrize(("rays", "widened"), [(0, True), (100, False)])
def test_a_hole_that_nobody_sees_into_is_straight(monkeypatch, rays, widened):
    hull = narrowing_bore()
    nothing = SimpleNamespace(contour_rays=(np.array([[-1, 0.3, 0.2]]), np.array([[1.0, 0, 0]])))
    monkeypatch.setattr(widening, "disagreements", lambda *_: (1.0, 1.0 * bool(rays), rays))
    opened, prisms = widening.widen(nothing, hull, [], [])
    in_bore = np.array([[0.585, 0.5, 0.5], [0.5, 0.415, 0.45], [0.57, 0.5, 0.6]])
    elsewhere = np.array([[0.62, 0.5, 0.5], [0.5, 0.38, 0.5], [0.78, 0.55, 0.35], [0.3, 0.5, 0.5]])
    assert (opened.scene().signed_distance(in_bore) > 0).all() == widened
    assert (opened.scene().signed_distance(elsewhere) < 0).all()
    assert bool(prisms) == widened


def test_faces_elsewhere_end_no_hole():
    """The walls of a slot in a block's side lie between the ends of a bore, and not beside it."""
    x, _, z = np.moveaxis(GRID, -1, 0)
    slot = np.minimum(0.06 - np.abs(z - 0.5), 0.3 - x)
    hull = narrowing_bore()
    hull = hull.with_field(np.minimum(hull.field, -slot).astype(np.float32))
    heights = {0.1: -1.0, 0.44: 1.0, 0.56: -1.0, 0.9: 1.0}
    faces = [SimpleNamespace(normal=np.array([0, 0, side]), offset=side * h) for h, side in heights.items()]
    longest = holes(hull, np.array([0, 0, 1.0]), faces)[0].prisms[0]
    assert longest.depth == pytest.approx(0.8)
    assert (longest.signed_distance(np.array([[0.585, 0.5, 0.5], [0.5, 0.415, 0.45]]), 0.0) < 0).all()


def test_a_hole_is_no_wider_past_the_floor_of_its_counterbore():
    x, y, z = np.moveaxis(GRID, -1, 0)
    block = np.minimum.reduce([0.3 - np.abs(x - 0.5), 0.3 - np.abs(y - 0.5), 0.4 - np.abs(z - 0.5)])
    bore = np.where(z > 0.5, 0.2, 0.08) - np.hypot(x - 0.5, y - 0.5)
    hull = Volume(np.minimum(block, -bore).astype(np.float32), np.zeros(3), SPACING)
    faces = [
        SimpleNamespace(normal=np.array([0, 0, side]), offset=side * height)
        for height, side in ((0.1, -1.0), (0.5, 1.0), (0.9, 1.0))
    ]
    assert all(cut.prisms[0].depth < 0.45 for cut in holes(hull, np.array([0, 0, 1.0]), faces))
