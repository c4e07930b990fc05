"""A simulated slide with an effect that its model does not know."""

from __future__ import annotations

import numpy as np
import xarray as xr

from robustpolish.datasets.stored import dataset
from robustpolish.models import Damper, Dof, Input, MechanicalModel, Output, Spring
from robustpolish.simulation.run import simulate

_RATE, _SAMPLES = 1000.0, 2000
_FRICTION = 3.0


def sticky_slide() -> tuple[MechanicalModel, xr.Dataset]:
    """Return the model of a slide on a spring, and a record of the slide as it is: with friction.

    A small case to try things on: a diagnosis finds the friction of 3 N in some seconds. The
    record is simulated and always the same.

    Returns
    -------
    model : MechanicalModel
        2 kg on 80 kN/m with 12 N s/m, driven by ``F``; without friction.
    data : xarray.Dataset
        Force ``F`` in N and displacement ``x`` in m over ``time`` in s, 2 s at 1 kHz, with noise
        of 1 um.

    Examples
    --------
    >>> import robustpolish as rp
    >>> model, data = rp.datasets.sticky_slide()
    >>> rp.compare(model, data).fit_percent < 50
    True
    """
    place = ("x", "ground")
    model = MechanicalModel(
        dofs=(Dof("x", 2.0),),
        springs=(Spring(place, 8e4),),
        dampers=(Damper(place, 12.0),),
        inputs=(Input("F", place),),
        outputs=(Output("x", place),),
        name="slide",
    )
    random = np.random.default_rng(1)
    # The force is held from sample to sample, and slow enough for that.
    force = 40 * np.convolve(random.standard_normal(_SAMPLES + 7), np.ones(8) / 8, "valid")
    data = dataset({"F": (force, "N")}, _RATE, "simulated: the model with dry friction")
    truth = model.with_effect("coulomb_friction", place, {"force": _FRICTION})
    motion = simulate(truth, data).outputs[:, 0]
    data["x"] = ("time", motion + 1e-6 * random.standard_normal(_SAMPLES), {"units": "m"})
    return model, data
