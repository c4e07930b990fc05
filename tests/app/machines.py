"""A spindle on its slide: the machine that designs are tried on."""

SPINDLE = """
name = "spindle on its slide"
[dof.slide]
mass = 12.0
[dof.spindle]
mass = 3.5
[[spring]]
between = ["slide", "ground"]
stiffness = 4.0e6
[[spring]]
between = ["spindle", "slide"]
stiffness = 9.0e5
[[damper]]
between = ["slide", "ground"]
damping = 300.0
[[damper]]
between = ["spindle", "slide"]
damping = 40.0
[[input]]
name = "F_cut"
force_on = "spindle"
[[input]]
name = "F"
force_on = "slide"
[[output]]
name = "x"
measures = "slide"
[[output]]
name = "acc"
measures = "spindle"
quantity = "acceleration"
"""

DESIGN = """
[design]
controls = ["F"]
measurements = ["x"]
performance = ["spindle"]
disturbances = ["F_cut"]
control_weight = 1e-6
measurement_noise = 1e-3
[design.actuators.F]
bandwidth_hz = 1000.0
limit = 200.0
[design.sensors]
x = { bandwidth_hz = 5000.0 }
"""

WEIGHTS = """
[weights]
performance = { low = 20.0, crossover_hz = 10.0, high = 0.3 }
effort = { low = 1e-8, crossover_hz = 5e4, high = 10.0 }
"""
