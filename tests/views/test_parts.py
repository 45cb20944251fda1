"""Bundled parts: valid single solids, reproducible, varied by the seed."""

import math

import pytest
from brepgaussian.errors import InputError
from brepgaussian.views.parts import HOLDOUT, PARTS, build_part, parse_part
from counted_faces import BY_MODULE
from scipy.integrate import quad

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
    assert build_part("block_hole").volume == pytest.approx(60 * 40 * 30 - math.pi * 10**2 * 30, rel=1e-9)


def test_face_kinds_are_the_five_that_primitives_know():
    known = {"PLANE", "CYLINDER", "CONE", "SPHERE", "TORUS"}
    for name in PARTS:
        assert set(types(build_part(name))) <= known, name


COMBINED = [name for name, info in PARTS.items() if info.module in ("machine", "fixture")]


@pytest.mark.parametrize("name", COMBINED)
def test_parts_of_several_features_are_of_moderate_complexity(name):
    solid = build_part(name)
    assert 6 <= len(solid.faces()) <= 30
    assert max(solid.bounding_box().size) < 8 * min(solid.bounding_box().size)


def frustum(a, b, height):
    """Volume of a cone cut off, radii a and b."""
    return math.pi * height * (a * a + a * b + b * b) / 3


def test_a_pulley_has_the_volume_of_its_rings():
    rim = math.pi * (36**2 - 23**2) * 22
    groove = 2 * frustum(36, 28, 4.5) + math.pi * 28**2 * 5 - math.pi * 36**2 * 14
    web, hub = math.pi * (23**2 - 13**2) * 6, math.pi * (13**2 - 7**2) * 29
    assert build_part("v_pulley").volume == pytest.approx(rim + groove + web + hub, rel=1e-9)


def test_a_t_nut_has_the_volume_of_the_formula():
    section = 42 * 12 - 4 * 4 + 22 * 12
    hole = math.pi * 6**2 * (24 - 1.8) + frustum(6, 7.8, 1.8)
    assert build_part("t_nut").volume == pytest.approx(section * 36 - hole, rel=1e-9)


def test_a_step_bracket_has_the_volume_of_the_formula():
    step = 72 * 0.42
    slot = (24 - 8) * 8 + math.pi * 4**2
    corners = 2 * (9**2 - math.pi * 9**2 / 4)
    low, high = ((72 - step) * 44 - slot - corners) * 12, step * 44 * 30 - math.pi * 6**2 * 17
    assert build_part("step_bracket").volume == pytest.approx(low + high, rel=1e-9)


COUNTED = {name: counts for parts in BY_MODULE.values() for name, counts in parts.items()}


@pytest.mark.parametrize(("module", "counted"), BY_MODULE.items())
def test_every_part_of_a_module_is_counted(module, counted):
    assert set(counted) == {name for name, info in PARTS.items() if info.module == module}


@pytest.mark.parametrize("name", COUNTED)
@pytest.mark.parametrize("seed", [0, 1, 2, 3, 4, 5])
def test_counted_parts_keep_their_faces_at_every_seed(name, seed):
    found = types(build_part(name, seed))
    kinds = ("PLANE", "CYLINDER", "CONE", "SPHERE", "TORUS")
    assert tuple(found.count(kind) for kind in kinds) == COUNTED[name]


def test_a_tube_connector_has_the_volume_of_the_formula():
    depth, corners = 72 * 0.55, 5**2 * (4 - math.pi)
    socket, bore = 46 - 2 * 6, 46 - 2 * (6 + 4.8)
    holes = math.pi * 6**2 * 2 * 6 + math.pi * 5**2 * 2 * (6 + 4.8)
    solid = (46**2 - corners) * 72 - socket**2 * depth - bore**2 * (72 - depth) - holes
    assert build_part("tube_connector").volume == pytest.approx(solid, rel=1e-9)


def test_a_pipe_elbow_has_the_volume_of_its_pieces():
    along = 15 + 30 * math.pi / 2 + 15  # of the axis: Pappus
    ring = math.pi * (15.2**2 - 10**2)
    chamfer = math.pi * 15.2**2 * 1.4 - frustum(15.2, 13.8, 1.4)
    half = 15.2 + 9.5
    plate = 4 * half**2 - 6**2 * (4 - math.pi) - math.pi * 15.2**2 - 4 * math.pi * 2.8**2
    assert build_part("pipe_elbow").volume == pytest.approx(ring * along - chamfer + plate * 7, rel=1e-7)


def test_a_pocket_housing_has_the_volume_of_the_formula():
    pocket = ((80 - 2 * 16) * (54 - 2 * 8) - 7**2 * (4 - math.pi)) * (32 - 8)
    drilled = math.pi * 3.1**2 * 13 + frustum(3.1, 0, 3.1 / math.tan(math.radians(59)))
    solid = 80 * 54 * 32 - pocket - 2 * drilled - math.pi * 5.5**2 * 8
    assert build_part("pocket_housing").volume == pytest.approx(solid, rel=1e-9)


def test_a_cover_lid_has_the_volume_of_the_formula():
    plate = (80 * 58 - 9**2 * (4 - math.pi)) * 9
    holes = 4 * (math.pi * 3.2**2 * (9 - 2.8) + frustum(3.2, 6, 2.8))
    spigot = math.pi * 16.5**2 * (8 - 1.6) + frustum(16.5, 14.9, 1.6)
    solid = plate - holes + spigot - math.pi * 7.5**2 * (9 + 8)
    assert build_part("cover_lid").volume == pytest.approx(solid, rel=1e-9)


def test_a_drive_plate_has_the_volume_of_the_formula():
    half = math.acos(33 / 38)
    disk = math.pi * 38**2 - (38**2 * half - 33 * 38 * math.sin(half))
    hexagon = 6 * 9**2 * math.tan(math.pi / 6)
    slots = 3 * (13 * 7 + math.pi * 3.5**2)
    solid = (disk - slots) * 10 + math.pi * 17**2 * 9 - hexagon * 19
    assert build_part("drive_plate").volume == pytest.approx(solid, rel=1e-9)


CASTING = {"pump_cover": 17, "yoke_end": 17, "cam_disk": 11, "window_frame": 31, "spray_nozzle": 17}


@pytest.mark.parametrize("name", CASTING)
def test_castings_keep_their_faces_at_every_seed(name):
    assert [len(types(build_part(name, seed))) for seed in range(5)] == [CASTING[name]] * 5


def test_a_window_frame_has_the_volume_of_the_formula():
    plate = (84 * 60 - 4 * 6**2 / 2) * 12
    window = (58 * 34 - 5**2 * (4 - math.pi)) * 5 + 49 * 25 * (12 - 5)
    slots = 2 * ((18 - 5) * 5 + math.pi * 2.5**2) * 12
    assert build_part("window_frame").volume == pytest.approx(plate - window - slots, rel=1e-9)


def test_a_rack_bar_has_the_volume_of_the_formula():
    flank = 9 * 0.13
    gap = 9 - 9 * 0.35 - 2 * flank
    section = (2 * 14 + 5 * 9) * 20 - 5 * (gap + flank) * 5
    holes = 2 * math.pi * (2.8**2 * (15 - 4) + 4.8**2 * 4)
    assert build_part("rack_bar").volume == pytest.approx(section * 15 - holes, rel=1e-9)


def over(function, reach):
    """Integral of a function of y over -reach..reach."""
    return quad(function, -reach, reach, limit=200)[0]


def test_a_chamfered_plate_has_the_volume_of_the_formula():
    top = (70 * 44 + 4 * 68 * 42 + 66 * 40) / 6 * 2  # of a frustum with the chamfers
    cut = 12 * (20 * 10 + math.pi * 25) + 2 * math.pi * (3.2**2 * 12 + 4**2 * 7)
    assert build_part("chamfered_plate").volume == pytest.approx(70 * 44 * 10 + top - cut, rel=1e-9)


def test_a_keyway_journal_has_the_volume_of_the_formula():
    body = frustum(12.5, 14, 1.5) + math.pi * (14**2 * 32.5 + 10**2 * 26.8) + frustum(10, 8.8, 1.2)
    key = over(lambda y: (12 + 2 * math.sqrt(9 - y * y)) * (math.sqrt(14**2 - y * y) - 10), 3)
    assert build_part("keyway_journal").volume == pytest.approx(body - key, rel=1e-6)


def test_a_milled_cover_has_the_volume_of_the_formula():
    plate = (64 * 48 - (4 - math.pi) * 8**2) * 14
    pocket = (42 * 28 - (4 - math.pi) * 6**2) * 9
    assert build_part("milled_cover").volume == pytest.approx(plate - pocket - 4 * math.pi * 2.6**2 * 14, rel=1e-9)


def test_a_guide_block_has_the_volume_of_the_formula():
    block = 60 * (36 * 34 - 2 * 8 - 10 * 12 - 8 * 5)
    slot = (11.5 * 6.5 + math.pi * 3.25**2) * 22
    assert build_part("guide_block").volume == pytest.approx(block - slot - math.pi * 25 * 36, rel=1e-9)


def test_a_coupling_hub_has_the_volume_of_the_formula():
    body = math.pi * (30**2 * 8 + 16**2 * 16.5) + frustum(16, 14.5, 1.5) - math.pi * 8**2 * 26
    key = 26 * over(lambda y: 11 - math.sqrt(64 - y * y), 2.5)
    slot = 8 * over(lambda y: math.sqrt(900 - y * y) - 25.5, 3)
    screw = over(lambda x: 2 * math.sqrt(2.4**2 - x * x) * (math.sqrt(256 - x * x) - math.sqrt(64 - x * x)), 2.4)
    holes = 4 * math.pi * 2.7**2 * 8
    assert build_part("coupling_hub").volume == pytest.approx(body - key - slot - screw - holes, rel=1e-5)  # of splines


def test_volumes_of_parts_made_for_scoring():
    wheel = math.pi * (32**2 * 14 - 25**2 * 8 + 12**2 * 16 - 6.5**2 * 22 - 5 * 3.2**2 * 6)
    key = 22 * over(lambda y: 9 - math.sqrt(6.5**2 - y * y), 2)
    assert build_part("gear_blank").volume == pytest.approx(wheel - key, rel=1e-5)
    angle = (34 * 7 + 33 * 7) * 60 + 2 * 6 * triangle(34 * 0.85, 40 * 0.85, 7)
    slot = 7 * (14 * 6 + math.pi * 9)
    assert build_part("corner_brace").volume == pytest.approx(angle - slot - 2 * math.pi * 9 * 7, rel=1e-6)
    plate = (52**2 - (4 - math.pi) * 64) * 8 + math.pi * 17**2 * 2
    neck = frustum(15, 11, 9) + math.pi * 11**2 * 10
    holes = math.pi * (8**2 * 29 + 4 * 9 * 8)
    assert build_part("neck_flange").volume == pytest.approx(plate + neck - holes, rel=1e-6)


def triangle(width, height, wall):
    """Area of a right triangle outside of an angle of two legs, `wall` thick, along its sides."""
    scale = 1 - wall / width - wall / height
    return width * height / 2 * scale**2


def test_mounts_have_the_volumes_of_the_formulas():
    slots = 4 * (8 * 5 + math.pi * 2.5**2) * 9
    plate = 64**2 * 9 + math.pi * (14**2 * 5 - 9**2 * 14)
    assert build_part("motor_mount").volume == pytest.approx(plate - slots, rel=1e-6)
    angle = 60 * 22 + 22 * 34 - 9**2 * (1 - math.pi / 4) - 7 * 9
    holes = 2 * math.pi * (3.2**2 * 5 + 6**2 * 5)
    assert build_part("lock_plate").volume == pytest.approx(angle * 10 - holes, rel=1e-6)
    cradle = 34 * over(lambda x: 30 - (32 - math.sqrt(144 - x * x)), math.sqrt(144 - 4))
    sides = 2 * (2.6 * 6 * 34 + math.pi * 9 * 30)
    assert build_part("cradle_block").volume == pytest.approx(60 * 34 * 30 - cradle - sides, rel=1e-5)


def test_a_rounded_case_has_the_volume_of_steiners_formula():
    a, b, c, r = 48, 28, 13, 6
    rounded = a * b * c + 2 * r * (a * b + b * c + c * a) + math.pi * r**2 * (a + b + c) + 4 / 3 * math.pi * r**3
    assert build_part("rounded_case").volume == pytest.approx(rounded - math.pi * 8**2 * 25, rel=1e-6)


def prism(length, width, radius, high):
    """Volume of a box with rounded upright edges."""
    return (length * width - radius**2 * (4 - math.pi)) * high


def test_bosses_have_the_volumes_of_the_formula():
    tray = 90 * 60 * 24 - 78 * 48 * 18 + 16 * 22 * 9 + math.pi * 8**2 * 12
    assert build_part("boss_tray").volume == pytest.approx(tray, rel=1e-9)
    pan = math.pi * (40**2 * 22 - 34**2 * 16 + 3 * 5.5**2 * 8 - 6**2 * 6)
    assert build_part("post_pan").volume == pytest.approx(pan, rel=1e-9)
    case = prism(72, 52, 9, 24) - prism(64, 44, 5, 20)
    bosses = 4 * math.pi * (5**2 * 14 - 2.5**2 * (14 - 18 * 0.3))
    assert build_part("screw_case").volume == pytest.approx(case + bosses, rel=1e-6)


def test_a_spoked_wheel_has_the_volume_of_the_formula():
    rings = math.pi * ((40**2 - 32**2) * 15 + (12**2 - 5**2) * 20)

    def along(y):  # a spoke's length beside its middle, between hub and rim
        return math.sqrt(32**2 - y * y) - math.sqrt(12**2 - y * y)

    assert build_part("spoked_wheel").volume == pytest.approx(rings + 50 * over(along, 3.5), rel=1e-6)


def test_links_have_the_volumes_of_the_formulas():
    half = math.acos((17 - 11) / 52)  # half the angle of the large circle that the belt leaves free
    belt = (17 + 11) * 52 * math.sin(half) + (math.pi - half) * 17**2 + half * 11**2
    bosses = math.pi * (17**2 * (28 - 9) + 11**2 * (18 - 9) - 9**2 * 28 - 5**2 * 18)
    assert build_part("rocker_arm").volume == pytest.approx(belt * 9 + bosses, rel=1e-6)
    sinks = 2 * math.pi * (3**2 * 10 + 2.5 * ((3**2 + 3 * 5.5 + 5.5**2) / 3 - 3**2))
    plate = prism(78, 44, 6, 10) - 9 * math.pi * 3.2**2 * 10
    assert build_part("nozzle_plate").volume == pytest.approx(plate - sinks, rel=1e-6)


def test_bars_and_discs_have_the_volumes_of_the_formulas():
    section = 32**2 - 6**2 * (4 - math.pi) - 24**2 + 3.6**2 * (4 - math.pi)
    assert build_part("square_tube").volume == pytest.approx(section * 60 - 2 * math.pi * 6**2 * 4, rel=1e-6)
    section = 2 * 34 * 7 + 6 * (48 - 7) + 4**2 * (4 - math.pi)
    assert build_part("i_beam").volume == pytest.approx(section * 56 - 2 * math.pi * 6**2 * 6, rel=1e-6)
    teeth = 12 * 34 * (34 - 6) / 2 * math.sin(math.pi / 6)
    segment = 2.5 * math.sqrt(9**2 - 2.5**2) + 9**2 * math.asin(2.5 / 9)  # of the bore, as wide as the key
    section = teeth - math.pi * 9**2 - (5 * 11.5 - segment)
    assert build_part("ratchet_wheel").volume == pytest.approx(section * 12, rel=1e-6)
    cap = 2 * math.sqrt(3) * 14**2 * 12 + 2 / 3 * math.pi * 12**3 - math.pi * 6**2 * 15
    assert build_part("cap_nut").volume == pytest.approx(cap, rel=1e-6)
    pins = math.pi * 8**2 * (2 * 16 + 2 * 11)
    assert build_part("spider").volume == pytest.approx(26**3 + pins - math.pi * 8**2 * 26, rel=1e-6)


def test_rods_and_moulded_parts_have_the_volumes_of_the_formulas():
    link = math.pi * 5.5**2 * (2 * math.pi * 14 + 2 * 30)
    assert build_part("chain_link").volume == pytest.approx(link, rel=1e-6)
    hook = math.pi * 5**2 * (math.pi * 18 + 34 + 2 / 3 * 5) + math.pi * 3.6**2 * 16
    assert build_part("j_hook").volume == pytest.approx(hook, rel=1e-6)
    tubes = 2 * math.pi * 16**2 * (0.4**2 - 0.28**2) * 15
    brick = 48 * 32 * 19 - 42 * 26 * 15 + 6 * math.pi * 4.8**2 * 4
    assert build_part("stud_brick").volume == pytest.approx(brick + tubes, rel=1e-6)
    steps = 8 * 56**2 * sum((1 - 0.22 * k) ** 2 for k in range(4))
    assert build_part("step_pyramid").volume == pytest.approx(steps - math.pi * 6**2 * 32, rel=1e-6)


def test_groups():
    assert set(REQUIRED) <= set(PARTS)
    held_out = [name for name, info in PARTS.items() if info.group == HOLDOUT]
    assert len(PARTS) == 191
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
