"""Bundled parts: small parametric solids that need no download, for tests, demos and benchmarks.

Each stands for one difficulty of reconstruction. Parts of the group `tuned` may be looked at while
methods are developed; parts of the group `holdout` are only measured.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from brepgaussian.errors import InputError, StageError

if TYPE_CHECKING:
    from build123d import Solid

TUNED, HOLDOUT = "tuned", "holdout"


@dataclass(frozen=True)
class PartInfo:
    """One bundled part.

    Attributes:
        module: module of this package that holds the function of the part's name.
        reason: which difficulty it stands for, one line.
        group: `tuned` or `holdout`.
    """

    module: str
    reason: str
    group: str

    def function(self, name: str) -> Callable[[Any], Any]:
        """The function that builds it (imports build123d)."""
        from importlib import import_module

        return getattr(import_module(f"{__name__}.{self.module}"), name)  # type: ignore[no-any-return]


PARTS: dict[str, PartInfo] = {
    "block_hole": PartInfo("prismatic", "a through hole, whose wall the visual hull sees badly", TUNED),
    "l_bracket": PartInfo("prismatic", "a concave edge and two holes of different axes", TUNED),
    "hex_nut": PartInfo("turned", "cone chamfers that meet planes in hyperbolas", TUNED),
    "flange": PartInfo("turned", "a bolt circle: many small equal cylinders", TUNED),
    "stepped_shaft": PartInfo("turned", "coaxial cylinders, a chamfer cone and a torus fillet", TUNED),
    "pocket_plate": PartInfo("prismatic", "three blind pockets that no silhouette shows", TUNED),
    "u_channel": PartInfo("prismatic", "an inner step hidden from most silhouettes", TUNED),
    "counterbore": PartInfo("prismatic", "a blind stepped hole, narrow at its floor", TUNED),
    "fillet_bracket": PartInfo("prismatic", "tangent cylinders without a luminance step", TUNED),
    "ball_pin": PartInfo("turned", "a sphere that meets a cylinder", TUNED),
    "ring_groove": PartInfo("turned", "a concave torus", TUNED),
    "polyhedron": PartInfo("prismatic", "planes in general position", TUNED),
    "oblique_hole": PartInfo("prismatic", "a cylinder oblique to its planes: elliptic edges", TUNED),
    "slotted_ring": PartInfo("turned", "a cylinder cut open: partial arcs", TUNED),
    "cross_tee": PartInfo("turned", "cylinder meets cylinder: space curves", TUNED),
    "heat_sink": PartInfo("prismatic", "many thin parallel walls and deep gaps", TUNED),
    "o_ring_gland": PartInfo("turned", "narrow annular grooves", TUNED),
    "pillow_block": PartInfo("prismatic", "a cylinder tangent to two walls over a wide foot", TUNED),
    "wedge_clamp": PartInfo("prismatic", "an inclined plane cut by a slot", TUNED),
    "cup": PartInfo("turned", "a hollow with a thin conical wall", TUNED),
    "gusset": PartInfo("prismatic", "a thin rib in a corner, edges that meet in mid-face", TUNED),
    "d_shaft": PartInfo("turned", "a flat on a cylinder and a cross hole", TUNED),
    "knob": PartInfo("turned", "a spherical cap, a cone and a blind hole", TUNED),
    "v_block": PartInfo("prismatic", "oblique walls over a narrow slot", HOLDOUT),
    "dovetail": PartInfo("prismatic", "an undercut", HOLDOUT),
    "keyed_hub": PartInfo("turned", "a keyway that breaks a bore", TUNED),
    "countersink_plate": PartInfo("prismatic", "countersinks (cones into cylinders) and a slot with round ends", TUNED),
    "bearing_race": PartInfo("turned", "a shallow torus between cylinders, small chamfers", HOLDOUT),
    "link_rod": PartInfo("turned", "walls tangent to two cylinders", HOLDOUT),
    "valve_stem": PartInfo("turned", "a narrow groove, a cross hole and flats on a cylinder beside a cone", TUNED),
    "step_bracket": PartInfo(
        "machine", "a slot with round ends, a blind hole and rounded corners on two steps", HOLDOUT
    ),
    "v_pulley": PartInfo("machine", "a V groove of cones and a thin web recessed on both sides", TUNED),
    "hinge_leaf": PartInfo("machine", "a thin wall tangent to a bored barrel, countersunk holes", TUNED),
    "bearing_cap": PartInfo("machine", "half a bore with an inner groove over an open base", TUNED),
    "clevis_fork": PartInfo("machine", "two cheeks with round ends, a cross bore, a blind hole in a shank", TUNED),
    "t_nut": PartInfo("machine", "small bevels, an undercut under shoulders, one chamfered bore", TUNED),
    "flanged_bushing": PartInfo("machine", "a rounded shoulder, chamfers and a hole through a curved wall", TUNED),
    "ribbed_base": PartInfo("machine", "thin ribs that run into a cylinder, a deep blind bore", TUNED),
    "hex_bolt": PartInfo("machine", "cone against planes in hyperbolas on one side, coaxial steps on the other", TUNED),
    "jet_body": PartInfo("turned", "a cone at the end, a blind bore that ports lead into, flats on a head", HOLDOUT),
    "adapter_stud": PartInfo("turned", "a hexagon and a collar between studs, a blind bore, chamfers", TUNED),
    "keyed_shaft": PartInfo("fixture", "a blind keyway on a cylinder, a narrow ring groove, small chamfers", TUNED),
    "tube_connector": PartInfo(
        "fixture", "inner walls that only the ends show, a hidden shoulder, holes in pairs", TUNED
    ),
    "pipe_elbow": PartInfo("fixture", "a torus between cylinders outside and inside, small holes in a flange", TUNED),
    "shoulder_screw": PartInfo("fixture", "a blind hexagonal socket, a rounded rim", HOLDOUT),
    "pocket_housing": PartInfo(
        "fixture", "a deep pocket with rounded corners, a port, drilled holes with conical tips", TUNED
    ),
    "ball_lever": PartInfo("fixture", "an oblique cone between a cylinder and a sphere, a small radial hole", TUNED),
    "cock_plug": PartInfo("fixture", "a cylinder through a cone, a square end on a round stem", TUNED),
    "cover_lid": PartInfo("fixture", "rounded corners, four countersunk holes, a spigot on the other side", TUNED),
    "seat_block": PartInfo("fixture", "a spherical hollow met by a cone and a cylinder", TUNED),
    "pump_cover": PartInfo("casting", "lugs that run into a round rim, a recess under a bored boss", TUNED),
    "rack_bar": PartInfo("casting", "a row of equal teeth, two counterbores", TUNED),
    "yoke_end": PartInfo("casting", "cheeks with round ends over a block, a stepped shank", TUNED),
    "cam_disk": PartInfo("casting", "nearly tangent cylinders, a keyed bore, unequal holes", TUNED),
    "window_frame": PartInfo("casting", "a stepped window with rounded corners, slots in narrow rims", TUNED),
    "spray_nozzle": PartInfo("casting", "a cone on a hexagon, a deep stepped bore with a small orifice", TUNED),
    "chamfered_plate": PartInfo("milled", "chamfers that meet in corners of four faces, blind holes", TUNED),
    "keyway_journal": PartInfo("milled", "a blind keyway with round ends, longer than the cylinder is wide", TUNED),
    "milled_cover": PartInfo("milled", "a pocket with rounded corners that no silhouette shows", TUNED),
    "guide_block": PartInfo("milled", "a stepped slot above a slot with round ends and a cross bore", TUNED),
    "coupling_hub": PartInfo("milled", "a keyed bore, a slotted rim, a radial hole", TUNED),
    "gear_blank": PartInfo("workshop", "a recess around a hub, holes through its floor, a keyed bore", HOLDOUT),
    "swivel_eye": PartInfo("workshop", "a stem that runs into a bored eye, a collar, a chamfered end", HOLDOUT),
    "corner_brace": PartInfo("workshop", "triangular webs at both ends of an inner corner, a slot", TUNED),
    "valve_body": PartInfo("workshop", "ports that meet a stepped bore, a boss on a rounded block", HOLDOUT),
    "slide_rail": PartInfo("workshop", "a V groove over ledges, counterbores that break into its walls", HOLDOUT),
    "end_stop": PartInfo("workshop", "a counterbore beside a slanting plane, over a notch", HOLDOUT),
    "step_pulley": PartInfo("workshop", "steps in a row, a small radial hole, a hollow below", TUNED),
    "crank_web": PartInfo("workshop", "tapered walls that run into hubs of unequal height, a shallow slot", TUNED),
    "shelf_bracket": PartInfo("workshop", "two ribs away from the ends of an inner corner, holes beside them", TUNED),
    "pipe_saddle": PartInfo("workshop", "half a bore whose rims are chamfered, thin ears", TUNED),
    "bleed_screw": PartInfo("workshop", "a blind bore that a small radial hole meets, a relief, a cone", TUNED),
    "neck_flange": PartInfo("fittings", "a cone between a plate and a tube, rounded corners", TUNED),
    "castle_nut": PartInfo("fittings", "three slots that cross in a bore, hyperbolas below", HOLDOUT),
    "soft_jaw": PartInfo("fittings", "a step, slots that break into a groove", TUNED),
    "stand_foot": PartInfo("fittings", "a cone between lugs, a deep blind hole, a shallow recess", HOLDOUT),
    "bent_plate": PartInfo("fittings", "rounded inner corners on either side of a thin wall", TUNED),
    "tee_lever": PartInfo("fittings", "small chamfers that end in a boss and a pad", TUNED),
    "union_nut": PartInfo("fittings", "a hexagon under a neck, a stepped bore with a conical seat", HOLDOUT),
    "motor_mount": PartInfo("mounts", "oblique slots with round ends, a low ring around a bore", HOLDOUT),
    "spindle_nose": PartInfo("mounts", "a slender cone between steps, flats that end on a cylinder", TUNED),
    "lock_plate": PartInfo("mounts", "counterbores close to walls, a notch, one rounded corner", HOLDOUT),
    "stop_collar": PartInfo(
        "mounts", "a slit that cuts all but one face, a stepped hole through curved walls", HOLDOUT
    ),
    "cradle_block": PartInfo("mounts", "a shallow cylinder between narrow lands, grooves", HOLDOUT),
    "drive_plate": PartInfo("mounts", "a hexagonal hole through a boss, slots with round ends, a flat", HOLDOUT),
    "split_hub": PartInfo("mounts", "a slit through a stepped hub, a counterbored hole across it, a keyway", TUNED),
    "rail_carriage": PartInfo("mounts", "a groove with sloped sides, blind holes across two faces", TUNED),
    "pillow_foot": PartInfo("mounts", "a wedge over a plate, a bore through a leaning face, slots", HOLDOUT),
    "cam_plate": PartInfo("mounts", "a bore off the middle of a disk, counterbores near corners, a slot", HOLDOUT),
    "gib_block": PartInfo("mounts", "a step, a slot from below, a blind hole in the end face", HOLDOUT),
    "latch_arm": PartInfo("mounts", "a hook with a sloped nose, a rib that ends before it, a round end", HOLDOUT),
    "spoked_wheel": PartInfo("rounded", "a hub that stands out of a rim, seen between spokes", TUNED),
    "rounded_case": PartInfo("rounded", "all edges rounded, with balls in the corners", TUNED),
    "rounded_angle": PartInfo("rounded", "rounded edges whose fillets meet without a ball", TUNED),
    "hat_bracket": PartInfo("rounded", "thin walls folded four times, a window with rounded corners", TUNED),
    "offset_sheet": PartInfo("rounded", "a thin sheet whose bends are rounded inside and outside", TUNED),
    "boss_tray": PartInfo("trays", "a pad and a post on a pocket's floor that end below its rim", TUNED),
    "board_case": PartInfo("trays", "drilled bosses in a case, below its rim", TUNED),
    "post_pan": PartInfo("trays", "posts in a round pan, around a bore", TUNED),
    "notched_tray": PartInfo("trays", "pads in a pocket whose rim a notch breaks", TUNED),
    "notched_pan": PartInfo("trays", "a post in a round pocket whose rim a notch breaks, over a square foot", TUNED),
    "relay_base": PartInfo("trays", "two posts in a pocket whose rim a notch breaks, and ears", HOLDOUT),
    "slotted_cup": PartInfo("trays", "a round pocket into which views look through a slot in its wall only", TUNED),
    "spout_pot": PartInfo("trays", "a thin round wall with a spout cut into it, over a flange", TUNED),
    "sensor_dish": PartInfo("trays", "a square post in a round pocket, below its rim", HOLDOUT),
    "terminal_box": PartInfo("trays", "pads in a pocket, below its rim, and a notch through a wall", TUNED),
    "meter_box": PartInfo("trays", "a pad and a post in a pocket with round corners and a notch", TUNED),
    "battery_case": PartInfo("trays", "a low wall across a pocket, two notches in its rim", TUNED),
    "relay_tray": PartInfo("trays", "two low walls across a pocket, a notch in each of two walls", HOLDOUT),
    "drain_cup": PartInfo("trays", "a thin round wall with two slots, holes through the floor, a square foot", HOLDOUT),
    "shaft_collar": PartInfo("drilled", "two set-screw holes that meet a bore", TUNED),
    "manifold_block": PartInfo("drilled", "ports that end in a blind bore, one of them counterbored", TUNED),
    "hub_flange": PartInfo("drilled", "a set-screw hole in a conical hub over a flange", TUNED),
    "vise_stop": PartInfo("drilled", "a hole that crosses a blind bore, a slot through the foot", TUNED),
    "valve_block": PartInfo("drilled", "a hole that joins two blind bores", TUNED),
    "union_cross": PartInfo("drilled", "bores that cross, and a port into them", TUNED),
    "set_knob": PartInfo("drilled", "a set-screw hole through a tapered hub into a blind bore", HOLDOUT),
    "guide_rail": PartInfo("drilled", "counterbored holes through a chamfered ridge", TUNED),
    "tool_post": PartInfo("drilled", "screw holes into a slot in the side", HOLDOUT),
    "index_plate": PartInfo("drilled", "a ring of holes around a boss", HOLDOUT),
    "clamp_pad": PartInfo("drilled", "a V below, a blind socket above", HOLDOUT),
    "tube_clamp": PartInfo("drilled", "a bore that a slit opens, a counterbored screw hole across it", HOLDOUT),
    "wheel_hub": PartInfo("drilled", "a stepped hub, a notch across its bore, a counterbore from below", TUNED),
    "rod_end": PartInfo("drilled", "an eye between flats on a round shank, a blind bore in that", HOLDOUT),
    "ring_housing": PartInfo("drilled", "a groove around a bore", TUNED),
    "seal_carrier": PartInfo("drilled", "a groove around the bore of a flange", HOLDOUT),
    "set_pin": PartInfo("mounts", "a flat between two shoulders on a pin, a cross hole", HOLDOUT),
    "port_cover": PartInfo("mounts", "a boss below a cover", HOLDOUT),
    "machine_foot": PartInfo("mounts", "a low pad below a foot, a stud", TUNED),
    "rocker_arm": PartInfo("links", "two bosses on a web that is tangent to both", HOLDOUT),
    "stop_block": PartInfo("links", "fillets around a top with rounded corners, a slot through, a blind hole", TUNED),
    "hose_barb": PartInfo("links", "two barbs, a hexagon, a bore", HOLDOUT),
    "nozzle_plate": PartInfo("links", "a grid of holes, two countersunk ones", HOLDOUT),
    "bar_handle": PartInfo("links", "fillets around a top with round ends, counterbores below", HOLDOUT),
    "hub_lever": PartInfo("links", "a fillet around a hub that an arm's sides cut off", TUNED),
    "desk_stand": PartInfo("links", "a sloping plate with a fillet at its foot, a lip, a slot", HOLDOUT),
    "screw_case": PartInfo("trays", "drilled bosses in the corners of a case", HOLDOUT),
    "spline_hub": PartInfo("hubs", "a bore with six grooves", HOLDOUT),
    "wing_nut": PartInfo("hubs", "wings that leave a cone", HOLDOUT),
    "gland_nut": PartInfo("hubs", "a groove below a hexagon, a conical seat", TUNED),
    "hex_standoff": PartInfo("hubs", "a deep blind bore, a chamfered stud", HOLDOUT),
    "eccentric_shaft": PartInfo("hubs", "an eccentric journal between collars, a keyway with round ends", TUNED),
    "bowl_flange": PartInfo("hubs", "a thin spherical shell", HOLDOUT),
    "square_tube": PartInfo("bars", "a square tube, rounded inside and outside, a hole across", HOLDOUT),
    "i_beam": PartInfo("bars", "fillets between a web and flanges, holes in the web", TUNED),
    "t_slot_plate": PartInfo("bars", "a slot like a T, two counterbored holes", TUNED),
    "ear_bracket": PartInfo("bars", "two ears with round tops, one hole across both", HOLDOUT),
    "slotted_angle": PartInfo("bars", "an angle with a rib, slots and holes", HOLDOUT),
    "fan_plate": PartInfo("bars", "a thin collar around a wide bore in a plate", HOLDOUT),
    "socket_screw": PartInfo("discs", "a hexagonal socket in a chamfered head", HOLDOUT),
    "arc_disc": PartInfo("discs", "curved slots around a boss, a pin", HOLDOUT),
    "piston": PartInfo("discs", "two narrow ring grooves, hollow below, a cross hole", HOLDOUT),
    "oil_washer": PartInfo("discs", "grooves across a ring that end at round sides", TUNED),
    "ratchet_wheel": PartInfo("discs", "saw teeth around a keyed bore", TUNED),
    "chain_plate": PartInfo("discs", "short flats between round ends and round waists", TUNED),
    "pulley_fork": PartInfo("bars", "cheeks with round ends, one hole across both", HOLDOUT),
    "gib_key": PartInfo("bars", "a taper of four degrees, chamfers that miss each other by .2 mm", HOLDOUT),
    "z_bracket": PartInfo("bars", "bends rounded inside and outside", HOLDOUT),
    "bearing_cover": PartInfo("discs", "a recess in a spigot, a bolt circle", HOLDOUT),
    "cap_nut": PartInfo("discs", "a hemisphere on a plane", TUNED),
    "thumb_knob": PartInfo("discs", "scallops around a knob", HOLDOUT),
    "step_cone": PartInfo("discs", "a cone between cylinders, a stepped bore, a cross hole", HOLDOUT),
    "spider": PartInfo("discs", "pins on a cube, in pairs", TUNED),
    "j_hook": PartInfo("rods", "a ball that ends a bent rod", TUNED),
    "u_bolt": PartInfo("rods", "a rod that goes on in a half ring on both sides", HOLDOUT),
    "chain_link": PartInfo("rods", "two half rings and two rods, all tangent", HOLDOUT),
    "tee_handle": PartInfo("rods", "a rod with balls for ends across another", HOLDOUT),
    "dumb_bell": PartInfo("rods", "two balls cut flat, on a bar", HOLDOUT),
    "hand_wheel": PartInfo("rods", "a whole torus that flat spokes run into", TUNED),
    "funnel": PartInfo("rods", "a thin cone over a thin tube", HOLDOUT),
    "spring_washer": PartInfo("rods", "two cones a sheet apart, slots from the bore", HOLDOUT),
    "pipe_tee": PartInfo("rods", "a pipe with a branch, beads and a flange", HOLDOUT),
    "bent_rod": PartInfo("rods", "a rod wider than the eye that it ends in", HOLDOUT),
    "wedge_pin": PartInfo("rods", "a ball on a taper, four degrees from tangent, a slot across its end", TUNED),
    "ring_bolt": PartInfo("rods", "a torus that a collar cuts off", TUNED),
    "cable_gland": PartInfo("rods", "a hexagon and a spigot on a rounded square", TUNED),
    "stud_brick": PartInfo("moulded", "tubes in a hollow that end level with its rim", TUNED),
    "vane_disc": PartInfo("moulded", "straight vanes from a hub to a rim", TUNED),
    "cable_clip": PartInfo("moulded", "a round groove that is open above", HOLDOUT),
    "star_knob": PartInfo("moulded", "round lobes around a disc, a blind bore", HOLDOUT),
    "split_block": PartInfo("moulded", "a seat for a bearing halfway through, chamfers", HOLDOUT),
    "drill_jig": PartInfo("moulded", "a bushing that leans over a plate", HOLDOUT),
    "disc_key": PartInfo("moulded", "a disc cut flat above its middle", HOLDOUT),
    "round_box": PartInfo("moulded", "a rounded foot, a step around a rim, a hollow", HOLDOUT),
    "dimple_cube": PartInfo("moulded", "spherical hollows in three faces", HOLDOUT),
    "step_pyramid": PartInfo("moulded", "squares turned by nine degrees", HOLDOUT),
    "hinge_knuckle": PartInfo("moulded", "three knuckles in a row, slots", HOLDOUT),
    "louver_panel": PartInfo("moulded", "two ribs with sloping backs on a thin panel", HOLDOUT),
    "motor_plate": PartInfo("moulded", "sides that bend by sixteen degrees, a slot that leans", TUNED),
    "tool_tray": PartInfo("moulded", "troughs with balls for ends", HOLDOUT),
    "profile_end": PartInfo("moulded", "a square plug below a rounded plate, a slot across", HOLDOUT),
}


def build_part(name: str, seed: int = 0) -> "Solid":
    """Build a bundled part; the OCP shape is its `.wrapped`.

    Args:
        name: a key of `PARTS`.
        seed: 0 gives the nominal part; others vary its sizes (mm) and numbers of features.

    Returns:
        One valid closed build123d solid, in mm.

    Raises:
        InputError: there is no such part, or the seed is negative.
        StageError: the kernel gave no valid single solid for this seed.
    """
    from brepgaussian.views.parts.sizes import Sizes

    if name not in PARTS:
        raise InputError(f"there is no bundled part {name!r}", fix=f"use one of: {', '.join(PARTS)}")
    if seed < 0:
        raise InputError(f"the seed of part {name!r} is {seed}", fix="give a seed of at least 0")
    part = PARTS[name].function(name)(Sizes(name, seed))
    solids = part.solids()
    if len(solids) != 1 or not solids[0].is_valid or solids[0].volume <= 0:
        raise StageError(f"part {name!r} with seed {seed} is not one valid solid", fix="use another seed")
    return solids[0]


def parse_part(path: str) -> tuple[str, int]:
    """Split `name` or `name:seed`.

    Raises:
        InputError: the seed is not a whole number.
    """
    name, _, seed = path.partition(":")
    try:
        return name, int(seed or 0)
    except ValueError:
        raise InputError(
            f"{path!r} has no whole number as seed", fix="write name or name:seed, as block_hole:3"
        ) from None
