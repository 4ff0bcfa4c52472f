"""Commented configuration templates for gears given by geometry and for a gearbox."""

#: Content of a new config.yaml.
TEXT = """\
# A gearlib project: describe your gears here. Then, in this folder,
#     gearlib gears            shows quantities computed from their geometry,
#     gearlib sweep            shows their vibrations over the speed,
#     gearlib workflow -j2     computes the targets and writes them to results/.
# Commented keys are optional. Numbers may have units, e.g. 2.5 mm; otherwise they are in SI units.
# All keys are listed in the configuration reference; `gearlib schema` prints a schema for editors.

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
  wheel:                    # module, width, angles and rack default to those of the pinion
    teeth: 61
    # internal: true        # for a ring gear, which also needs outer_diameter
  torque: 85 N m            # of the pinion; or power and speed
  backlash: 80 um           # normal; default: from shifts and distance, or ISO/TR 10064-2
  # centre_distance: 105 mm # default: zero backlash

dampings:
  usual: {damping_ratio: 0.05, backlash_damping_ratio: 0.0}

resonance:                  # largest and smallest displacement over the tuning
  step: 0.001

phase_planes:               # velocity over displacement at selected tunings
  tunings: [0.6, 0.8, 1.0]  # mesh frequency over natural frequency, or speeds such as 1500 rpm
"""
#: Content of the config.yaml of a gearbox; {file} is replaced by the path of its REXS file.
GEARBOX_TEXT = """\
# A gearbox. In this folder, `gearlib workflow -j2` computes all stages and load cases and the whole
# gearbox, and writes results/; `gearlib gearbox {file}` shows what the file contains and lacks.

gearbox:
  file: {file}
  damping_ratio: 0.05       # of each mesh
  points: 101               # number of speeds in the curves of each stage
  orders: 3                 # highest multiple of a mesh frequency in the Campbell diagram
  revolutions: 60           # number of revolutions of the run-up
"""
