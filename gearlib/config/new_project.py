"""Commented configuration templates for gears given by geometry and for a gearbox."""

#: Content of a new config.yaml.
TEXT = """\
# A project of gearlib: put your gears here. Then, in this folder,
#     gearlib gears            shows what their geometry comes to,
#     gearlib sweep            shows how they run,
#     gearlib workflow -j2     computes the targets, into results/.
# Keys that are comments may be left out. Numbers may have units, as 2.5 mm; bare ones are in SI.
# The reference of the configuration has all keys; `gearlib schema` prints it for editors.

targets: [resonance, phase_planes]

gears:
  pinion:                   # the driving gear
    teeth: 23
    module: 2.5 mm          # normal module
    width: 18 mm            # face width
    # shift: 0.0            # profile shift coefficient
    # pressure_angle: 20 deg
    # helix_angle: 0 deg
    # tip_diameter: 62.5 mm
    # bore: 20 mm
    # tip_relief: {amount: 10 um, length: 1 mm}
  wheel:                    # what it leaves out is as at the pinion: module, width, angles, rack
    teeth: 61
    # internal: true        # a ring gear, with its outer_diameter
  torque: 85 N m            # of the pinion; or power and speed
  backlash: 80 um           # normal; by default by shifts and distance, or ISO/TR 10064-2
  # centre_distance: 105 mm # by default without backlash

dampings:
  usual: {damping_ratio: 0.05, backlash_damping_ratio: 0.0}

resonance:                  # largest and smallest displacement over the tuning
  step: 0.001

phase_planes:               # velocity over displacement at single tunings
  tunings: [0.6, 0.8, 1.0]  # mesh frequency over eigenfrequency, or speeds as 1500 rpm
"""
#: Content of the config.yaml of a gearbox; {file} is replaced by the path of its REXS file.
GEARBOX_TEXT = """\
# A gearbox. In this folder, `gearlib workflow -j2` computes all its stages and load cases, and the
# whole box, into results/; `gearlib gearbox {file}` shows what the file says and leaves open.

gearbox:
  file: {file}
  damping_ratio: 0.05       # of each mesh
  points: 101               # speeds of the curve of a stage
  orders: 3                 # highest multiple of a mesh frequency in the Campbell diagram
  revolutions: 60           # of the run-up
"""
