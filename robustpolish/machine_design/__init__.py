"""From a machine and what is asked of its controller to a design that can be judged."""

from robustpolish.machine_design.asked_weights import asked_weight
from robustpolish.machine_design.design import ChannelGain, MachineDesign, design_machine
from robustpolish.machine_design.read import read_design_task
from robustpolish.machine_design.signals import machine_plant
from robustpolish.machine_design.task import DesignTask

__all__ = [
    "ChannelGain",
    "DesignTask",
    "MachineDesign",
    "asked_weight",
    "design_machine",
    "machine_plant",
    "read_design_task",
]
