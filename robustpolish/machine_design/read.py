"""What a file asks of a controller: its sections [design] and [weights]."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from robustpolish.errors import InvalidInputError
from robustpolish.machine_design.task import DesignTask
from robustpolish.models import GeneralizedPlant, MechanicalModel
from robustpolish.models.mechanical.toml import design_section, located
from robustpolish.validation import described, invalid, known_keys

_KEYS = tuple(item.name for item in fields(DesignTask) if item.name != "machine")


def read_design_task(
    machine: str | Path | MechanicalModel | GeneralizedPlant | DesignTask,
    section: str | Path | None = None,
    **changes: Any,
) -> DesignTask:
    """Read which controller a machine shall have.

    Parameters
    ----------
    machine : path, str, MechanicalModel, GeneralizedPlant or DesignTask
        A TOML file or text with a mechanical model, its sections ``[design]`` and ``[weights]`` at
        the end; a plant that was saved (``.json``); either of them loaded; or a task to be changed.
    section : path or str, optional
        Another TOML file or text with nothing but these sections, as a plant needs it.
    **changes
        What counts instead of the file's word: parameters of :class:`DesignTask` by name.

    Returns
    -------
    DesignTask

    Raises
    ------
    InvalidInputError
        If a file cannot be read, a key is unknown (with the nearest right one and the line), or
        something does not fit.

    Examples
    --------
    >>> import robustpolish as rp
    >>> task = rp.read_design_task('''
    ... [dof.x]
    ... mass = 2.0
    ... [[spring]]
    ... between = ["x", "ground"]
    ... stiffness = 800.0
    ... [[input]]
    ... name = "F"
    ... force_on = "x"
    ... [[output]]
    ... name = "x"
    ... measures = "x"
    ...
    ... [design]
    ... controls = ["F"]
    ... sensors.x = { bandwidth_hz = 500.0, noise = 1e-9 }
    ... delays.F = 1e-4
    ...
    ... [weights]
    ... performance = { low = 100.0, crossover_hz = 3.0, high = 0.5 }
    ... effort = 1e-5
    ... ''')
    >>> task.plant.disturbance_names, dict(task.plant.delays)
    (('disturbance_F', 'noise_measured_x'), {'F': 0.0001})
    >>> task.weighted.performance_names
    ('performance_measured_x', 'effort_F')
    """
    if isinstance(machine, DesignTask) and section is None:
        known_keys((), changes, _KEYS)
        return replace(machine, **changes)
    if section is not None:
        with located(section) as table:
            known_keys((), table, ("design", "weights"))
            return _task(_loaded(machine), design_section(table), changes)
    if not isinstance(machine, str | Path) or Path(machine).suffix == ".json":
        given = _loaded(machine)
        own = given.design if isinstance(given, MechanicalModel) else {}
        return _task(given, own, changes)
    model = MechanicalModel.from_toml(machine)
    with located(machine):
        return _task(model, model.design, changes)


def _loaded(machine: Any) -> MechanicalModel | GeneralizedPlant:
    if isinstance(machine, MechanicalModel | GeneralizedPlant):
        return machine
    if not isinstance(machine, str | Path):
        shown = described(type(machine).__name__)
        want = "a file, a MechanicalModel or a GeneralizedPlant"
        raise invalid("machine", shown, want, "Pass one of these.")
    if Path(machine).suffix == ".json":
        return GeneralizedPlant.load(machine)
    return MechanicalModel.from_toml(machine)


def _task(
    machine: MechanicalModel | GeneralizedPlant, section: Mapping[str, Any], changes: Any
) -> DesignTask:
    known_keys(("design",), section, _KEYS)
    known_keys((), changes, _KEYS)
    try:
        return DesignTask(machine, **{**section, **changes})
    except InvalidInputError as error:
        if error.key[:1] == ("weights",) or str(error.key[0]) in changes:
            raise
        raise InvalidInputError(str(error), ("design", *error.key)) from None
