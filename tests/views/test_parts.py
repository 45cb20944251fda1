"""Bundled parts: valid single solids, reproducible, varied by the seed."""

import pytest
from brepgaussian.errors import InputError
from brepgaussian.views.parts import HOLDOUT, PARTS, build_part, parse_part

REQUIRED = (
    "block_hole l_bracket hex_nut flange stepped_shaft pocket_plate u_channel counterbore fillet_bracket "
    "ball_pin ring_groove polyhedron oblique_hole slotted_ring"
).split()


def types(solid):
    return sorted(face.geom_type.name for face in solid.faces())


@pytest.mark.parametrize("name", PARTS)
def test_every_seed_gives_the_same_kinds_of_faces(name):
    nominal = build_part(name)
    for seed in (1, 2, 3):
        other = build_part(name, seed)
        assert set(types(other)) == set(types(nominal))
        assert other.volume != pytest.approx(nominal.volume, rel=1e-6)


def test_a_seed_is_reproducible():
    assert build_part("flange", 7).volume == build_part("flange", 7).volume


def test_a_block_with_a_hole_has_the_volume_of_the_formula():
    import math

    assert build_part("block_hole").volume == pytest.approx(60 * 40 * 30 - math.pi * 10**2 * 30, rel=1e-9)


def test_groups():
    assert set(REQUIRED) <= set(PARTS)
    held_out = [name for name, info in PARTS.items() if info.group == HOLDOUT]
    assert len(PARTS) >= 24
    assert len(held_out) * 3 >= len(PARTS)


def test_parse_part():
    assert parse_part("cup") == ("cup", 0)
    assert parse_part("cup:12") == ("cup", 12)


@pytest.mark.parametrize(("name", "seed"), [("teapot", 0), ("cup", -1)])
def test_bad_names_and_seeds(name, seed):
    with pytest.raises(InputError, match=name):
        build_part(name, seed)


def test_a_seed_that_is_no_number():
    with pytest.raises(InputError, match="name:seed"):
        parse_part("cup:x")
