"""A spindle on its slide: the machine that designs are tried on."""

from tests.machine_files import machine

SPINDLE = machine("spindle")
DESIGN, WEIGHTS = machine("spindle_design"), machine("spindle_weights")
