"""Machine files of motions that are told apart by their way there, by their end, or by nothing that holds them."""

from tests.machines.mechanisms import joint, surface

NEARING = """
[structure]
frequencies = "14.8040007, 64.6982401, 177.934313 Hz"
damping_ratios = [0, 0.00459260939, 0.0147675586]
[structure.shapes]
p0 = "0.260737272, -0.0482880395, 0.00568794668 kg^-1/2"
d = "-1.91415308, -0.762044232, 0.939816222 kg^-1/2"
[joint]
at = "p0"
clearance = "0.000442430329 m"
stops = "two"
stiffness = "1207474.57 N/m"
damping = "0 N s/m"
preload = "8.68952747 N"
[[drive]]
at = "d"
force = "7.82447984 N"
[operation]
speed = "3.03492243 Hz"
speed_range = "1.5 to 6 Hz"
clearance_range = "0.1 to 1 mm"
"""
"""Two stops, hardly damped: a long irregular way to an orbit of period 7, which it then nears slowly."""

SOFT = """
title = "Soft impact oscillator, one elastic stop (zeta 0.01, beta 29, e 1.26, a 0.7)"
[structure]
frequencies = "1 Hz"
damping_ratios = 0.01
[structure.shapes]
mass = "1 kg^-1/2"
[joint]
at = "mass"
clearance = "1.26 mm"
stops = "one"
stiffness = "1144.887 N/m"
damping = "0 N s/m"
[[drive]]
at = "mass"
unbalance = "700 g mm"
[operation]
speed = "0.8 Hz"
speed_range = "0.5 to 1.2 Hz"
clearance_range = "0.5 to 3 mm"
[tolerances]
speed = "2 %"
clearance = "5 %"
"""
"""One mode of 1 Hz against a soft stop: the parameters of Ing, Pavlovskaia and Wiercigroch, in millimetres."""

DYING = """
[structure]
frequencies = "12.4302726, 15.3581281485, 90.9902343187 Hz"
damping_ratios = "3.38021071538, 2.49205483665, 2.42971460879 %"
[structure.shapes]
p0 = "-1.01587221241, -0.974743979266, 1.23460073167 kg^-1/2"
d0 = "-0.86068688529, -0.884008701874, 1.01486408045 kg^-1/2"
[joint]
at = "p0"
clearance = "0.000129698347662 m"
stops = "two"
stiffness = "3112753.85251 N/m"
damping = "228.842671957 N s/m"
[[drive]]
at = "d0"
force = "1.02294280416 N"
harmonic = 3
[operation]
speed = "6.80410745116 Hz"
speed_range = "3.4 to 13.6 Hz"
clearance_range = "0.06 to 0.26 mm"
"""
"""Driven by a third harmonic alone: chaos that lasts for some 10,000 cycles, then period 2 or 3."""

TWO_PINS = f"""
[ground]
points = {{ shaft = "0, 0 mm", bore = "0, 4 mm" }}
gravity = "9.81 m/s^2"
[link.crank]
points = {{ shaft = "0, 0 mm", pin = "30, 0 mm" }}
[link.rod]
points = {{ big = "0, 0 mm", small = "110, 0 mm" }}
[[link.rod.body]]
mass = "0.32 kg"
centre = "38, 2 mm"
inertia = "6e-4 kg m^2"
[link.piston]
points = {{ pin = "0, 0 mm" }}
[[link.piston.body]]
mass = "0.28 kg"
inertia = "1e-4 kg m^2"
{joint("motor", "revolute", "ground.shaft", "crank.shaft", "driven = true")}
{joint("bigend", "revolute", "rod.big", "crank.pin", surface("0.08 mm", "12 N/um", "900 N s/m"))}
{joint("wrist", "revolute", "rod.small", "piston.pin", surface("0.05 mm", "9 N/um", "700 N s/m"))}
{joint("guide", "prismatic", "ground.bore", "piston.pin")}
[[force]]
at = "piston.pin"
direction = "180 deg"
force = "250, 120, 20, 0, -30, 0, 60, 180 N"
[operation]
speed = "900 rpm"
speed_range = "300 to 2000 rpm"
clearance_range = "0.02 to 0.2 mm"
[tolerances]
speed = "2 %"
bigend_clearance = "5 %"
wrist_clearance = "5 %"
"""
"""A small pump whose big end and wrist pin are worn: 8 states, whose derivative costs some five runs."""


RUBBING_TUBE = (
    """
[structure]
frequencies = "41.62, 166.5, 374.6, 666.0 Hz"
damping_ratios = "2 %"
[structure.shapes]
left = "1.511, 2.137, 1.511, 0 kg^-1/2"
middle = "2.137, 0, -2.137, 0 kg^-1/2"
right = "1.511, -2.137, 1.511, 0 kg^-1/2"
along = "0.3, 0.5, -0.4, 0.2 kg^-1/2"
span = "1.2, 1.9, 1.7, 0.4 kg^-1/2"
"""
    + "".join(
        f"""[[joint]]
name = "{place}"
at = "{place}"
clearance = "0.2 mm"
stiffness = "1 N/um"
damping = "30 N s/m"
{"friction = 0.2" if place == "middle" else ""}
{'tangent = "along"' if place == "middle" else ""}
{'tangential_stiffness = "0.5 N/um"' if place == "middle" else ""}
"""
        for place in ("left", "middle", "right")
    )
    + """[[drive]]
at = "span"
force = "12 N"
[operation]
speed = "40 Hz"
speed_range = "15 to 60 Hz"
clearance_range = "0.05 to 0.5 mm"
"""
)
"""The tube of ``docs/machines`` in three loose supports, one of which rubs."""


def held_by_friction(force: str) -> str:
    """Pressed on its stop by 50 N, which rubs along the drive's direction by 0.9."""
    return f"""
[structure]
frequencies = "5, 20 Hz"
damping_ratios = 0.02
modal_masses = "1, 1 kg"
[structure.shapes]
across = "1, 0.2"
along = "0.1, 1"
[joint]
at = "across"
clearance = "0.1 mm"
stops = "one"
stiffness = "1 N/um"
damping = "100 N s/m"
preload = "50 N"
friction = 0.9
tangent = "along"
[[drive]]
at = "along"
force = "{force}"
[operation]
speed = "9 Hz"
speed_range = "4 to 20 Hz"
clearance_range = "0.05 to 0.3 mm"
"""


def written(folder, text):
    """Path of a machine file with a text."""
    path = folder / "machine.toml"
    path.write_text(text)
    return path
