"""A diagnosis that ends with a learned law, made by no computation."""

from dataclasses import replace

import numpy as np
import xarray as xr

from robustpolish.identification.findings import FoundEffect, Value
from tests import made_up
from tests.effects.learned_curves import learned_law_of


def unknown_law():
    """The made-up diagnosis with friction and a hardening law of unknown make."""
    told = made_up.diagnosis()
    law = learned_law_of(lambda q: 4e9 * q**5, -0.01, 0.01, 9, at=("x", "ground"))
    effect = law.effect
    keys = [f"effect[1].c{j + 1}" for j in range(9)]
    found = FoundEffect(
        effect.kind, effect.at, {name: Value(v, 0.1, "N") for name, v in effect.values.items()}
    )
    return replace(
        told,
        verdict="unknown_law",
        model=replace(told.model, effects=(*told.model.effects, effect)),
        effects=(*told.effects, found),
        covariance=xr.DataArray(
            np.array(law.covariance), {"parameter": keys, "other": keys}, ("parameter", "other")
        ),
    )
