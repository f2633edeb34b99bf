"""Examples of `docs/scene-files.md`: tables of a file, which together have every key of their part."""

PEDESTAL = """\

[casing]                           # on which it stands
name = "pedestal"
mass = "40 kg"

[[support]]                        # between casing and ground
of = "pedestal"
stiffness = "200 MN/m"
"""

SECOND_LINE = """\

[casing]                           # the second line, as one mass
name = "second line"
mass = "20 kg"

[[support]]                        # its bearings
of = "second line"
stiffness = "4e6 N/m"
"""

EXAMPLES = {
    "flexible": [
        """\
[shaft]
model = "flexible"                 # may be left out
length = "1.2 m"
diameter = "100 mm"
inner_diameter = "20 mm"           # a bore
material = "steel"
nodes = 8                          # in each span between stations, 2 to 24
shear = true
rotary_inertia = true
polar_ratio = 2.0                  # polar over diametral inertia of a section; 0 has no gyroscopics
rule = "spectral"
constraints = [{at = "0 m", holds = "pin"}, {at = "0.9 m"}]
steps = [{at = "0.3 m", diameter = "120 mm"}, {at = "0.9 m", diameter = "80 mm"}]
""",
        """\
[shaft]                            # clamped at 0, of two stiffnesses
length = "0.7 m"
diameter = "20 mm"
constraints = [{at = "0 m", holds = "clamp"}]
nodes = "auto"                     # up to 8, as many as each span needs
anisotropy = 0.1                   # 10 % stiffer along one axis than the mean, 10 % softer across
""",
    ],
    "massless": [
        """\
[shaft]
model = "massless"
length = "1 m"
at = "0.4 m"                       # the one station that is known
k11 = "2e5 N/m"
k12 = "-1e4 N"
k22 = "5e3 N m"
anisotropy = 0.05
damping = "10 N s/m"
ends = "rigid"
"""
    ],
    "rigid": [
        """\
[shaft]
model = "rigid"
length = "0.453 m"
constraints = [{at = "93 mm"}, {at = "360 mm"}]  # two pins; [] leaves it to its supports
"""
    ],
    "coaxial_shaft": [
        """\
[shafts.lp]                        # the first one turns at the speed of [spin]
length = "0.962 m"
diameter = "20 mm"

[shafts.hp]                        # a tube around it
length = "0.382 m"
diameter = "34 mm"
inner_diameter = "28 mm"
ratio = 1.3                        # 1.3 times as fast; -1.2 would be counter-rotation
speed = "0 rad/s"                  # that is added to it
start = "0.3 m"                    # its left end
phase = "0 deg"                    # its angle while that of the first one is 0

[[supports]]
at = "lp 0 m"
kxx = "5e5 N/m"

[[supports]]
at = "lp 0.962 m"
kxx = "6e5 N/m"

[[supports]]
at = "hp 0.3 m"
kxx = "8e5 N/m"

[[supports]]                       # between the shafts, at the right end of hp
at = "hp 0.682 m"
on = "lp"
kxx = "6e5 N/m"

[internal_damping]
shaft = "hp"
voigt_time = "0.1 ms"
"""
    ],
    "step": [
        """\
[[shaft.steps]]                    # in the order of their stations
at = "0.3 m"
diameter = "120 mm"
inner_diameter = "20 mm"
material = "steel"
"""
    ],
    "constraint": [
        """\
[[shaft.constraints]]
at = "0 m"
holds = "clamp"                    # displacement and slope; a pin holds the one, a guide the other
"""
    ],
    "material": [
        """\
[shaft.material]
youngs_modulus = "211 GPa"
density = "7810 kg/m^3"
shear_modulus = "81.2 GPa"
"""
    ],
    "disc": [
        """\
[[disc]]
at = "0.4 m"
mass = "80 kg"
diametral = "1.8 kg m^2"
polar = "3.6 kg m^2"
offset = "20 um"
offset_angle = "30 deg"
tilt = "0.1 deg"
tilt_axis = "90 deg"
exact = true
"""
    ],
    "disc given by its dimensions": [
        """\
[disc]
at = "0.4 m"
diameter = "250 mm"
thickness = "40 mm"
bore = "40 mm"
density = "7850 kg/m^3"
"""
    ],
    "thin disc": ['[disc]\nat = "0.4 m"\nmass = "80 kg"\nradius = "300 mm"\n'],
    "unbalance": [
        '[[unbalance]]\nat = "0.4 m"\nmass = "80 kg"\neccentricity = "20 um"\nphase = "90 deg"\n',
        '[unbalance]\nat = "0.4 m"\nmoment = "1600 g*mm"             # m e, as balancing sheets have it\n'
        'since = "0.2 s"                    # when a blade is lost; left out, it is there always\n',
    ],
    "unbalance given by its grade": [
        """\
[unbalance]
at = "0.4 m"
grade = "G6.3"                     # e Omega = 6.3 mm/s, ISO 21940-11
mass = "80 kg"                     # of the rotor
speed = "3000 rpm"                 # of service; that of a constant [spin] unless given
"""
    ],
    "casing": [
        """\
[casing]                           # a housing, a pedestal, a frame: a mass that does not tilt
name = "pedestal"
mass = "40 kg"

[[support]]                        # bearing between shaft and pedestal
at = "0.1 m"
stiffness = "80 MN/m"
on = "pedestal"

[[support]]                        # foundation between pedestal and ground
of = "pedestal"
kxx = "200 MN/m"
kyy = "120 MN/m"
cxx = "1e4 N s/m"
cyy = "1e4 N s/m"
"""
    ],
    "support": [
        """\
[[support]]                        # as bearing reports print it
at = "0.1 m"
kxx = "8e7 N/m"
kxy = "1e7 N/m"
kyx = "-2e7 N/m"
kyy = "4e7 N/m"
cxx = "2e5 N s/m"
cxy = "0 N s/m"
cyx = "0 N s/m"
cyy = "1e5 N s/m"
angular_stiffness = "1e4 N m/rad"
angular_damping = "10 N m s/rad"
rotating = false                   # true: it turns with the shaft
""",
        """\
[[support]]                        # the same as matrices, [[xx, xy], [yx, yy]]
at = "0.1 m"
stiffness = [[8e7, 1e7], [-2e7, 4e7]]
damping = [[2e5, 0], [0, 1e5]]
""",
        """\
[[support]]                        # tables over the speed of rotation
at = "0.1 m"
speeds = ["1000 rpm", "3000 rpm", "6000 rpm"]
kxx = ["9e7 N/m", "8e7 N/m", "7e7 N/m"]
kyy = ["5e7 N/m", "6e7 N/m", "6.5e7 N/m"]
kxy = [1e7, 2e7, 3e7]
kyx = [-2e7, -3e7, -4e7]
cxx = "2e5 N s/m"                  # the same at every speed
cyy = [1e5, 9e4, 8e4]
hold = true                        # constant beyond the ends; false: no values there
one_sense = true                   # for the sense of `speeds` alone; false: read at |Omega|
speeds_of = "first"                # of several shafts; "sum" or "difference" between two of them
""",
        """\
[[support]]                        # a seal: tables over the frequency of whirl
at = "0.1 m"
frequencies = ["0 rad/s", "200 rad/s", "600 rad/s"]
kxx = ["-2e5 N/m", "1e5 N/m", "1.4e6 N/m"]  # kyy is the same, unless given
kxy = [2e5, 2e5, 2e5]
kyx = [-2e5, -2e5, -2e5]
cxx = "2e3 N s/m"
mxx = "0.4 kg"                     # added mass, the same along x and y
interpolation = "linear"           # between nodes; "pchip", smooth, unless given
""",
        """\
[[support]]                        # by means and axes
at = "0.1 m"
stiffness = "20 MN/m"
anisotropy = 0.2                   # 24 MN/m along the axis at `angle`, 16 MN/m across it
angle = "30 deg"
cross_stiffness = "-1 MN/m"
damping = "500 N s/m"
damping_anisotropy = 0.1
damping_angle = "0 deg"
cross_damping = "0 N s/m"
""",
        """\
[[casing]]                         # a bearing on a pedestal, which stands on a foundation
name = "pedestal"
mass = "40 kg"

[[support]]
at = "0.1 m"
stiffness = "80 MN/m"
on = "pedestal"                    # in place of the ground

[[support]]
of = "pedestal"                    # in place of the shaft
stiffness = "200 MN/m"
""",
    ],
    "limiter": [
        """\
[[limiter]]
at = "0.4 m"
angles = ["0 deg", "120 deg", "240 deg"]
gap = "0.3 mm"
stiffness = "5 MN/m"
damping = "50 N s/m"
friction = 0.1
rim_radius = "125 mm"
""",
        """\
[limiter]                          # smoothed
at = "0.4 m"
angle = "90 deg"
gap = "0.3 mm"
stiffness = "5 MN/m"
blend = "10 um"
slip = "0.1 m/s"
on = "pedestal"
"""
        + PEDESTAL,
    ],
    "annular_stator": [
        """\
[annular_stator]
at = "0.4 m"
gap = "0.3 mm"
stiffness = "20 MN/m"
damping = "2 kN s/m"
friction = 0.15
rim_radius = "125 mm"
offset = "50 um"                   # of the centre of the ring
angle = "270 deg"                  # of that offset
blend = "5 um"
slip = "0.1 m/s"
on = "pedestal"                    # whose mass and suspension it has
"""
        + PEDESTAL
    ],
    "journal_bearing": [
        """\
[journal_bearing]
at = "0.4 m"
viscosity = "0.02 Pa s"
radius = "25 mm"
length = "20 mm"
clearance = "50 um"                # radial
offset = "10 um"                   # of the centre of the bush from the axis
angle = "270 deg"                  # of that offset
blend = "0.1 1/s"                  # smooths the film where it does not move
cavitated = true                   # false: the full film, which bears negative pressure
modes = 2                          # of the pressure along a film of finite length; 0: short
on = "pedestal"
"""
        + PEDESTAL
    ],
    "squeeze_film": [
        """\
[squeeze_film]                     # its cage is a support at the same station
at = "0.4 m"
viscosity = "0.01 Pa s"
radius = "60 mm"
length = "25 mm"
clearance = "120 um"               # radial
offset = "10 um"
angle = "270 deg"
blend = "0.1 1/s"
cavitated = true                   # false: the full film of a sealed damper under pressure
modes = 0
on = "pedestal"
"""
        + PEDESTAL
    ],
    "seal": [
        """\
[seal]
at = "0.4 m"
clearance = "0.4 mm"               # radial
stiffness = "6e5 N/m"              # of the centred shaft
damping = "1800 N s/m"
swirl = 0.46                       # mean speed of the fluid over that of the shaft
inertia = "4 kg"
exponent = 2                       # by which stiffness and damping grow towards the wall
swirl_exponent = 0.6
offset = "10 um"
angle = "270 deg"
on = "pedestal"
"""
        + PEDESTAL
    ],
    "rolling_bearing": [
        """\
[rolling_bearing]                  # numbers of a 6306 with 8 balls
at = "0.4 m"
balls = 8
stiffness = 13.34e9                # N/m^n, of one ball; n is the exponent
gap = "20 um"                      # on one side
inner_radius = "40.1 mm"
outer_radius = "63.9 mm"           # the ratio of both counts
exponent = 1.111                   # of rollers; 3/2, of balls, may be left out
angle = "-90 deg"                  # of ball 0 at the start
outer_speed = -0.6                 # over the speed of the shaft, of an outer race that turns back
blend = "0.01 um"
linear = "mean"                    # cage of linear analyses; "frozen": at `angle`
on = "pedestal"
"""
        + PEDESTAL
    ],
    "loose_pedestal": [
        """\
[loose_pedestal]                   # under a bearing of the shaft
name = "block"
mass = "12 kg"
stiffness = "5e7 N/m"              # of the foundation, which can only press
damping = "8e3 N s/m"
bolt_stiffness = "2e7 N/m"
bolt_damping = "4e3 N s/m"
play = "40 um"                     # lift until the bolts hold
angle = "-90 deg"                  # to the foundation

[[support]]                        # between shaft and pedestal
at = "0.4 m"
on = "block"
stiffness = "8e6 N/m"
"""
    ],
    "coupling": [
        """\
[coupling]
at = "0.4 m"
on = "second line"                 # a casing; without it the second line is held
stiffness = "8e5 N/m"              # the mean along all axes
anisotropy = 0.3                   # 30 % stiffer along one axis, 30 % softer across it
angle = "0 deg"                    # of that axis at the start; it turns with the shaft
offset = "0.2 mm"                  # of the second line
direction = "90 deg"               # it is above the axis of the shaft
angular_stiffness = "2e3 N m/rad"
tilt = "1 mrad"                    # of the second line
tilt_direction = "0 deg"
"""
        + SECOND_LINE,
    ],
    "oldham_coupling": [
        """\
[oldham_coupling]
at = "0.4 m"
on = "second line"                 # a casing; without it the second line is held
mass = "1.5 kg"                    # of the floating disc
offset = "0.2 mm"                  # of the second line
direction = "90 deg"
angle = "0 deg"                    # of the slot in the shaft's hub at the start
"""
        + SECOND_LINE,
    ],
    "crack": [
        """\
[crack]                            # of a shaft whose stiffness at the station is 1e6 N/m
at = "0.4 m"
loss = "3e5 N/m"                   # of stiffness along the weak axis
loss_across = "5e4 N/m"
angle = "0 deg"                    # of the weak axis at the start
tension = "-90 deg"                # the side below opens
breathing = "switch"               # or "mayes", smoothly by the angle; "response"
""",
        """\
[crack]                            # a hinge of a flexible shaft
at = "0.4 m"
compliance = "2e-6 rad/(N m)"      # jump of slope by the moment that opens it
compliance_across = "5e-7 rad/(N m)"
""",
    ],
    "magnetic_bearing": [
        """\
[magnetic_bearing]
at = "0.1 m"
constant = 4e-6                    # N m^2/A^2, of a pair of coils
bias = "3 A"
gap = "0.4 mm"
kp = 15000.0                       # A/m
ki = 6e5                           # A/(m s)
kd = 15.0                          # A s/m
filter = "0.1 ms"                  # of the derivative
lag = "0.15 ms"                    # of the amplifier
limit = "3 A"                      # of the current beside the bias
angle = "45 deg"                   # of the first axis
sensor = "0.12 m"                  # where the displacement is read
on = "pedestal"
"""
        + PEDESTAL,
        """\
[magnetic_bearing]                 # a controller of one's own: a lead compensator
at = "0.1 m"
constant = 4e-6
bias = "3 A"
gap = "0.4 mm"
numerator = [16.5, 15000.0]        # falling powers of p; A over m
denominator = [1e-4, 1.0]
""",
    ],
    "linear_magnetic_bearing": [
        """\
[linear_magnetic_bearing]
at = "0.1 m"
current_factor = 300.0             # N/A
position_factor = "2.25 MN/m"      # positive: it pulls outward
kp = 15000.0                       # A/m
ki = 6e5                           # A/(m s)
kd = 15.0                          # A s/m
filter = "0.1 ms"                  # of the derivative
lag = "0.15 ms"                    # of the amplifier
angle = "0 deg"
sensor = "0.12 m"
current_across = 300.0             # along the second axis
position_across = "2.28 MN/m"
name = "drive end"                 # of its coordinates
on = "pedestal"
"""
        + PEDESTAL,
        """\
[linear_magnetic_bearing]
at = "0.1 m"
current_factor = 300.0
position_factor = "2.25 MN/m"
numerator = [16.5, 15000.0]
denominator = [1e-4, 1.0]
""",
    ],
    "cubic_spring": [
        """\
[cubic_spring]
at = "0.4 m"
angle = "0 deg"
stiffness = "1e12 N/m^3"
on = "pedestal"
"""
        + PEDESTAL
    ],
    "gravity": ['[gravity]\nacceleration = "9.81 m/s^2"\nangle = "-90 deg"\n'],
    "external_damping": [
        '[external_damping]\nper_length = "9 N s/m^2"\nanisotropy = 0.1\nangle = "0 deg"\n'
    ],
    "disc_damping": [
        '[disc_damping]\nat = "0.4 m"\ntranslational = "100 N s/m"\nangular = "5 N m s"\n'
    ],
    "internal_damping": ['[internal_damping]\nvoigt_time = "0.2 ms"\n'],
    "rayleigh_damping": ['[rayleigh_damping]\nmass = "6 1/s"\nstiffness = "20 us"\n'],
    "modal_damping": ["[modal_damping]\nratios = [0.01, 0.02]              # of the first modes\n"],
    "hysteretic_damping": ["[hysteretic_damping]\nloss_factor = 0.01\n"],
    "ball_balancer": [
        """\
[ball_balancer]
at = "0.4 m"
ball_mass = "12 g"
race_radius = "90 mm"
drag_coefficient = "0.02 kg/s"
places = 5
in_use = 4
rolling = 1.4
ball_radius = "8 mm"
"""
    ],
    "ball_contact": ['[ball_contact]\nstiffness = "1e5 N/m"\ndamping = "1 N s/m"\n'],
    "constant": [
        '[spin]\nmodel = "constant"                 # may be left out\nspeed = "1500 rpm"\n'
    ],
    "profile": [
        """\
[spin]
model = "profile"
times = ["0 s", "2 s", "5 s"]
speeds = ["0 rpm", "3000 rpm", "3000 rpm"]
"""
    ],
    "drive": [
        """\
[spin]
model = "drive"                    # I Omega. = torque - slope Omega - drag Omega^2 - ..
speed = "600 rad/s"                # to begin with
torque = "1950 N m"
slope = "1.57 N m s"
drag = "0.039 N m s^2"
odd = true
coulomb = "2 N m"
table_speeds = ["0 rad/s", "300 rad/s"]
table_torques = ["10 N m", "0 N m"]
polar = "2.2 kg m^2"               # that of the scene unless given
feedback = false
stops = true
"""
    ],
    "sweep": [
        """\
[sweep]                            # what `jaxrotor sweep` does when nothing else is said
settle = 200
keep = 50
steps_per_revolution = 256

[sweep.over]
"spin.speed" = "1000 rpm : 4000 rpm : 41"
"unbalance.eccentricity" = ["10 um", "20 um"]

[sweep.start]
radius = "0.7 mm"
rate = "-400 rad/s"                # negative: a backward whirl
angle = "0 deg"
"""
    ],
    "machine": [
        """\
[machine]                          # what `jaxrotor api` asks for
slowest = "7000 rpm"               # minimum operating speed
fastest = "10000 rpm"              # maximum continuous speed
trip = "10500 rpm"
rated = "9500 rpm"                 # of the power of its stages
name = "feed gas compressor"       # in the title of a report
bearings = ["0.25 m", "2.15 m"]    # those of the scene, where it has two
couplings = ["0.04 m"]
gas_density = "20 kg/m^3"          # mean of suction and discharge
probes = [{at = "0.31 m", name = "drive end"}, {at = "2.09 m", name = "thrust end"}]
clearances = [{at = "1.2 m", diametral = "0.5 mm"}]
stages = [{power = "600 kW", diameter = "400 mm", width = "16 mm", density_ratio = 1.16}]
"""
    ],
    "probe": [
        """\
[[machine.probes]]
at = "0.31 m"
name = "drive end"
"""
    ],
    "close clearance": [
        """\
[[machine.clearances]]
at = "1.95 m"
diametral = "0.4 mm"
name = "balance drum"
"""
    ],
    "stage": [
        """\
[[machine.stages]]
kind = "centrifugal"               # or "axial", which has no density ratio
name = "stage 1"
at = "0.6 m"                       # only of an overhung machine
power = "620 kW"
diameter = "400 mm"
width = "22 mm"
density_ratio = 1.18
"""
    ],
}
