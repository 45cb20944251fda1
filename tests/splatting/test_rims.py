"""Rims that views show of openings: where they are, and which sections they tell."""

from dataclasses import replace

import numpy as np
import pytest
from brepgaussian.splatting.concave.rims import at_rim, rim_of
from brepgaussian.splatting.concave.sections import Keyed, Polygon, Rounded, Section
from drawings import CENTER, GRID, SECTIONS, SHAPE, rim_seen


@pytest.mark.parametrize("height", [0.0, 0.7, -0.7])
@pytest.mark.parametrize("name", ["circle", "slot", "pocket", "hexagon", "keyed", "flatted"])
def test_the_rim_is_found_where_all_views_show_it(name, height):
    true = SECTIONS[name]
    stack, centers = rim_seen(true, height)
    rough = replace(true.grown(-0.6), center=(CENTER[0] + 0.4, CENTER[1] - 0.3))
    if isinstance(rough.shape, Rounded) and name == "slot":  # its ends are seen by few views
        rough = replace(rough, shape=Rounded((rough.shape.half[0] - 1.5, rough.shape.half[1]), rough.shape.radius))
    found = at_rim(rough, stack, centers, 1.5)
    assert found is not None
    assert found.at_rim
    assert type(found.shape) is type(true.shape)
    places = true.border(200)
    assert np.abs(found.signed_distance(places[~true.near_corners(places, 0.6)])).max() < 0.25
    if isinstance(true.shape, Rounded):
        assert abs(found.shape.radius - true.shape.radius) < 0.6


def test_without_a_rim_the_cells_count():
    section = SECTIONS["slot"]
    stack, centers = rim_seen(section, 0.0)
    for grey in (90.0, np.nan):  # the plane is as dark as what lies below; no view sees it
        blind = replace(stack, grey=np.full_like(stack.grey, grey))
        assert at_rim(section, blind, centers, 1.5) == section
        assert at_rim(replace(section, misfit=0.3), blind, centers, 1.5) is None


@pytest.mark.parametrize("turn", [0.0, 0.4])
def test_a_section_that_reaches_into_walls_moves_only_where_its_rim_can_be_seen(turn):
    true = Section(CENTER, turn, Rounded((15.0, 12.0), 0.0))
    stack, centers = rim_seen(true, 0.3)

    def covered(at):  # in the walls of a corner
        local = (at - np.array(CENTER)) @ np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        return (local > np.array([8.0, 6.0])).any(axis=1)

    stack = replace(stack, grey=np.where(covered(GRID.reshape(-1, 2)).reshape(SHAPE), np.nan, stack.grey))
    way = np.array([np.cos(turn), np.sin(turn)])
    rough = replace(true, center=tuple(CENTER - 0.75 * way), shape=Rounded((15.75, 12.0), 0.0))  # one side 1.5 off
    found = rim_of(rough, stack, centers, 1.5, 0.3, covered)
    assert found is not None
    assert found.told > 0.6
    places = true.border(200)
    assert np.abs(found.section.signed_distance(places[~true.near_corners(places, 1.5)])).max() < 0.25


def test_a_rim_of_another_shape_is_no_section():
    stack, centers = rim_seen(Section(CENTER, 0.3, Rounded((16.0, 16.0), 6.0)), 0.0)
    assert at_rim(Section(CENTER, 0.0, Polygon(8, 16.5)), stack, centers, 1.5) is None


def test_a_slot_of_cells_that_looks_keyed_is_a_slot_if_the_rim_says_so():
    """A keyway as wide as its bore: a slot with one square end, to the cells."""
    slot = Section(CENTER, 0.4, Rounded((30.5, 7.2), 7.2))
    way = np.array([np.cos(0.4), np.sin(0.4)])
    drawn = Section(tuple(CENTER - 23.3 * way), 0.4, Keyed(7.2, 7.1, 53.2), misfit=0.16)
    stack, centers = rim_seen(slot, 0.0)
    found = at_rim(drawn, stack, centers, 1.5)
    assert found is not None
    assert isinstance(found.shape, Rounded)
    assert np.abs(found.signed_distance(slot.border(200))).max() < 0.25


def test_a_small_octagon_of_cells_is_a_bore_if_the_rim_says_so_and_else_nothing():
    bore = Section(CENTER, 0.0, Rounded((7.2, 7.2), 7.2))
    drawn = Section(CENTER, 0.2, Polygon(8, 7.0), misfit=0.1)
    stack, centers = rim_seen(bore, 0.0)
    found = at_rim(drawn, stack, centers, 1.5)
    assert found is not None
    assert isinstance(found.shape, Rounded)
    assert abs(found.shape.radius - 7.2) < 0.25
    blind = replace(stack, grey=np.full_like(stack.grey, 90.0))
    assert at_rim(drawn, blind, centers, 1.5) is None
    assert at_rim(replace(SECTIONS["hexagon"], misfit=0.1), blind, centers, 1.5) is not None
