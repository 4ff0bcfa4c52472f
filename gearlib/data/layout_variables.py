"""Units and descriptions of where the gears of a train lie."""

#: name -> (CF units, long_name)
DESCRIPTIONS = {
    "body_x": ("m", "axis of the body without errors, at phase 0, counted from the first carrier"),
    "body_y": ("m", "axis of the body without errors, at phase 0, counted from the first carrier"),
    "body_radius": ("m", "largest working pitch radius; of a carrier that of its pins"),
    "body_turns": ("1", "rotation of the body in the housing over the phase of the reference mesh"),
    "carried_by": ("1", "body that carries the axis, empty: none"),
    "shaft_line": ("1", "number of the line of shafts on which the body sits, 0: none"),
    "mesh_gear": ("1", "bodies that mesh"),
    "pitch_radius": ("m", "working pitch radius, of a ring gear negative"),
    "mesh_x": ("m", "pitch point at phase 0"),
    "mesh_y": ("m", "pitch point at phase 0"),
    "frame_turns": ("1", "rotation of all axes about the first over the reference mesh's phase"),
    "misfit": ("m", "by how much positions of one axis that are given in several ways differ"),
}
