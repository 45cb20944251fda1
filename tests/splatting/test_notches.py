"""Slots that two opposite faces show: cut through to their floors and corners, but for what stands in them."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from blocks import BLOCK
from brepgaussian.splatting import opened as stage
from brepgaussian.splatting.concave import notches
from brepgaussian.splatting.concave.notches import _drawn, _notches, _Shown, _stands, _surely
from brepgaussian.splatting.concave.prism import Lattice, Prism
from brepgaussian.splatting.concave.sections import Rounded, Section
from build123d import Align, Box, Pos, Rot
from rendered import missed, rendered
from scipy.ndimage import distance_transform_edt
from skimage.morphology import convex_hull_image

LOW = (Align.CENTER, Align.CENTER, Align.MIN)


def comb():
    """Four deep slots: no camera looks along their floors."""
    part = Box(70, 50, 36, align=LOW)
    for x in (-24, -8, 8, 24):
        part -= Pos(x, 0, 9) * Box(6, 60, 40, align=LOW)
    return Rot(0, 0, 11) * part


def test_slots_between_fins_reach_their_floors(tmp_path, monkeypatch):
    views, truth = rendered(tmp_path, comb(), 50, 600)
    over, under = missed(views, truth)
    monkeypatch.setattr(stage, "open_notches", lambda images, volume, planes: (volume, []))
    before, _ = missed(views, truth)
    assert over < 0.004 < before
    assert under < 0.002


@pytest.mark.parametrize("high", [8, 20])
def test_what_stands_in_a_slot_stays(tmp_path, high):
    """Both ends of the slot show nothing of it."""
    part = Box(70, 60, 36, align=LOW) - Pos(4, 0, 9) * Box(34, 70, 40, align=LOW)
    part += Pos(4, 6, 9) * Box(34, 9, high, align=LOW)
    views, truth = rendered(tmp_path, part, 40, 500)
    assert missed(views, truth)[1] < 0.006


def test_cells_of_a_notch_without_a_section_keep_clear_of_the_blur_along_its_face(monkeypatch):
    """Not of the side where it is open."""
    face = np.ones((40, 60), bool)
    rows, columns = np.indices(face.shape)
    face[np.abs(columns - 30) < 12 - 0.7 * np.minimum(rows, 16)] = False  # a gap between teeth
    lattice = Lattice(np.zeros(3), *np.eye(3), 0.01, face.shape)
    whole = convex_hull_image(face)
    (notch,) = _notches(face, whole)
    monkeypatch.setattr(notches, "fitted", lambda outline, opened: None)
    drawn = _drawn(
        None, _Shown(SimpleNamespace(lattice=lattice), face, whole, [notch]), Prism(lattice, notch, 1.0, True, 0.0)
    )
    away = distance_transform_edt(~face)
    assert away[drawn.outline].min() > 1.5
    assert drawn.outline[0].any()
    assert (notch & (away > 4) & ~drawn.outline).sum() == 0


def test_a_slab_of_a_notch_about_which_views_agree_is_no_part_of_it():
    lattice = Lattice(np.zeros(3), *np.eye(3), 0.01, (20, 20))
    notch = Prism(lattice, np.ones((20, 20), bool), 1.0, True, 0.0)
    at = np.column_stack([np.full((1200, 2), 0.1), -np.linspace(0, 0.999, 1200)])
    before = np.full(1200, 0.5)
    assert not _stands(notch, at, before, np.full(1200, 0.4))
    rib = np.abs(at[:, 2] + 0.45) < 0.05
    assert _stands(notch, at, np.where(rib, 0.2, before), np.where(rib, 1.2, 0.2))
    few = rib & (np.arange(1200) % 10 == 0)  # tell next to nothing
    kept = ~rib | few
    assert not _stands(notch, at[kept], np.where(rib, 0.2, before)[kept], np.where(rib, 1.2, 0.2)[kept])


def test_a_notch_is_open_to_the_side_of_its_face():
    face = np.zeros((60, 80), bool)
    face[5:55, 5:75] = True
    face[5:35, 20:32] = False  # a notch
    face[5:35, 40:44] = False  # too narrow to be told from blur
    face[20:34, 54:68] = False  # a hole
    (notch,) = _notches(face, convex_hull_image(face))
    np.testing.assert_array_equal(np.argwhere(notch).min(axis=0), [5, 20])
    np.testing.assert_array_equal(np.argwhere(notch).max(axis=0), [34, 31])


def test_cells_along_the_edge_of_a_notch_do_not_cost_it_the_rays_that_graze_its_lips(tmp_path):
    """A slot like a T: what overhangs its foot shows at contours of many views."""
    part = Box(64, 50, 22, align=LOW) - Pos(0, 0, 9) * Box(80, 9, 40, align=LOW)
    part -= Pos(0, 0, 9) * Box(80, 18, 6, align=LOW)
    views, truth = rendered(tmp_path, part, 50, 600)
    over, under = missed(views, truth)
    assert over < 0.004
    assert under < 0.003


def test_of_a_notch_with_a_section_all_counts():
    outline = np.zeros((20, 20), bool)
    outline[4:16, 4:16] = True
    cells = Prism(Lattice(np.zeros(3), *np.eye(3), 0.01, (20, 20)), outline, 1.0, True, 0.0)
    assert _surely(cells).outline.sum() == 8 * 8
    drawn = replace(cells, section=Section((9.5, 9.5), 0.0, Rounded((6.0, 6.0), 0.0)))
    assert _surely(drawn) is drawn


@pytest.mark.parametrize(
    ("rays", "worse", "deep", "believed"),
    [(6, 2.2, 1.0, False), (6, 1.2, 1.0, True), (80, 1.2, 1.0, False), (3, 1.0, 1.0, False), (3, 9.0, 0.02, True)],
)
def test_few_rays_refuse_a_notch(monkeypatch, rays, worse, deep, believed):
    """About which they agree much less (through a wheel's hub, by six rays), or that is large: views look into such."""
    cells = np.zeros((40, 40), bool)
    cells[10:30, 10:30] = True
    lattice = Lattice(np.array([0.3, 0.3, 1.0]), *np.eye(3), 0.01, cells.shape)
    told = np.ones(rays, bool)
    said = np.zeros((rays, 3)), (np.full(rays, 0.5), told), (np.full(rays, 0.5 * worse), told), 0.0
    monkeypatch.setattr(notches, "changes", lambda *a: said)
    monkeypatch.setattr(notches, "lost_share", lambda *a: 0.0)
    chords = SimpleNamespace(within=lambda prism, margin: np.zeros(1, bool))
    cut = notches._cut(None, BLOCK, BLOCK.scene(), Prism(lattice, cells, deep, False, 0.0), chords)
    assert (cut is not None) == believed
