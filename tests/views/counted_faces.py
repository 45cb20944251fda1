"""Faces of bundled parts by module: plane, cylinder, cone, sphere, torus, counted by hand on the drawing."""

Counts = dict[str, tuple[int, int, int, int, int]]

FIXTURE: Counts = {
    "keyed_shaft": (9, 7, 2, 0, 0),
    "tube_connector": (15, 8, 0, 0, 0),
    "pipe_elbow": (7, 12, 1, 0, 2),
    "shoulder_screw": (11, 3, 1, 0, 1),
    "pocket_housing": (11, 7, 2, 0, 0),
    "ball_lever": (3, 4, 3, 1, 0),
    "cock_plug": (8, 3, 2, 0, 0),
    "cover_lid": (7, 10, 5, 0, 0),
    "seat_block": (10, 3, 1, 1, 0),
}
MOUNTS: Counts = {
    "motor_mount": (15, 10, 0, 0, 0),
    "spindle_nose": (8, 6, 1, 0, 0),
    "set_pin": (6, 3, 0, 0, 0),
    "port_cover": (3, 5, 0, 0, 0),
    "machine_foot": (8, 6, 1, 0, 0),
    "lock_plate": (14, 5, 0, 0, 0),
    "stop_collar": (5, 5, 2, 0, 0),
    "cradle_block": (15, 3, 0, 0, 0),
    "drive_plate": (16, 8, 0, 0, 0),
    "split_hub": (9, 7, 0, 0, 0),
    "rail_carriage": (15, 5, 0, 0, 0),
    "pillow_foot": (14, 5, 0, 0, 0),
    "cam_plate": (12, 10, 0, 0, 0),
    "gib_block": (13, 3, 0, 0, 0),
    "latch_arm": (12, 2, 0, 0, 0),
}
ROUNDED: Counts = {
    "spoked_wheel": (24, 4, 0, 0, 0),
    "rounded_case": (6, 13, 0, 8, 0),
    "rounded_angle": (8, 9, 0, 0, 0),
    "hat_bracket": (18, 10, 0, 0, 0),
    "offset_sheet": (12, 10, 0, 0, 0),
}
TRAYS: Counts = {
    "boss_tray": (17, 1, 0, 0, 0),
    "board_case": (15, 16, 0, 0, 0),
    "post_pan": (6, 6, 0, 0, 0),
    "notched_tray": (24, 0, 0, 0, 0),
    "notched_pan": (12, 7, 0, 0, 0),
    "relay_base": (28, 3, 0, 0, 0),
    "slotted_cup": (13, 5, 0, 0, 0),
    "spout_pot": (7, 7, 0, 0, 0),
    "sensor_dish": (12, 3, 0, 0, 0),
    "terminal_box": (24, 4, 0, 0, 0),
    "meter_box": (20, 7, 0, 0, 0),
    "drain_cup": (15, 5, 0, 0, 0),
    "battery_case": (22, 0, 0, 0, 0),
    "relay_tray": (26, 1, 0, 0, 0),
    "screw_case": (19, 16, 0, 0, 0),
}
DRILLED: Counts = {
    "shaft_collar": (2, 4, 2, 0, 0),
    "manifold_block": (10, 4, 0, 0, 0),
    "hub_flange": (3, 7, 1, 0, 0),
    "vise_stop": (11, 4, 0, 0, 0),
    "valve_block": (8, 4, 0, 0, 0),
    "union_cross": (6, 4, 0, 0, 0),
    "set_knob": (4, 3, 2, 0, 0),
    "guide_rail": (15, 6, 0, 0, 0),
    "tool_post": (10, 4, 0, 0, 0),
    "index_plate": (3, 9, 0, 0, 0),
    "clamp_pad": (12, 1, 0, 0, 0),
    "tube_clamp": (10, 4, 0, 0, 0),
    "wheel_hub": (11, 9, 0, 0, 0),
    "rod_end": (4, 4, 1, 0, 0),
    "ring_housing": (8, 3, 0, 0, 0),
    "seal_carrier": (5, 9, 1, 0, 0),
}
LINKS: Counts = {
    "rocker_arm": (6, 4, 0, 0, 0),
    "stop_block": (11, 9, 0, 0, 4),
    "hose_barb": (12, 3, 2, 0, 0),
    "nozzle_plate": (6, 15, 2, 0, 0),
    "bar_handle": (6, 8, 0, 0, 2),
    "hub_lever": (5, 4, 0, 0, 1),
    "desk_stand": (12, 3, 0, 0, 0),
}
HUBS: Counts = {
    "spline_hub": (21, 12, 0, 0, 0),
    "wing_nut": (11, 3, 1, 0, 0),
    "gland_nut": (10, 3, 1, 0, 0),
    "hex_standoff": (10, 2, 1, 0, 0),
    "eccentric_shaft": (9, 7, 0, 0, 0),
    "bowl_flange": (3, 4, 0, 2, 0),
}
BARS: Counts = {
    "square_tube": (10, 10, 0, 0, 0),
    "i_beam": (14, 6, 0, 0, 0),
    "t_slot_plate": (16, 4, 0, 0, 0),
    "ear_bracket": (14, 8, 0, 0, 0),
    "slotted_angle": (15, 6, 0, 0, 0),
    "fan_plate": (7, 10, 0, 0, 0),
    "pulley_fork": (8, 5, 0, 0, 0),
    "gib_key": (12, 0, 0, 0, 0),
    "z_bracket": (12, 7, 0, 0, 0),
}
DISCS: Counts = {
    "socket_screw": (10, 2, 2, 0, 0),
    "arc_disc": (4, 12, 0, 0, 0),
    "piston": (7, 8, 1, 0, 0),
    "oil_washer": (17, 2, 4, 0, 0),
    "ratchet_wheel": (29, 1, 0, 0, 0),
    "chain_plate": (6, 6, 0, 0, 0),
    "bearing_cover": (4, 10, 0, 0, 0),
    "cap_nut": (9, 1, 0, 1, 0),
    "thumb_knob": (3, 14, 0, 0, 0),
    "step_cone": (3, 6, 1, 0, 0),
    "spider": (10, 5, 0, 0, 0),
}

BY_MODULE = {
    "bars": BARS,
    "discs": DISCS,
    "drilled": DRILLED,
    "fixture": FIXTURE,
    "hubs": HUBS,
    "links": LINKS,
    "mounts": MOUNTS,
    "rounded": ROUNDED,
    "trays": TRAYS,
}
