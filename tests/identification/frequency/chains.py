"""Chains of masses, and their frequency responses with noise."""

import numpy as np

import robustpolish as rp
from robustpolish.signals.frequency_response import labelled_response

LINES = np.arange(5.0, 120.0, 0.25)


def two_masses(quantity="displacement", stiffness=(2e5, 1e5), damping=4.0, masses=(2.0, 1.0)):
    """Two masses on ground, driven at the first, both measured."""
    pairs = [("a", "ground"), ("a", "b")]
    return rp.MechanicalModel(
        [rp.Dof("a", masses[0]), rp.Dof("b", masses[1])],
        [rp.Spring(pair, k) for pair, k in zip(pairs, stiffness, strict=True)],
        [rp.Damper(pair, damping) for pair in pairs],
        [rp.Input("F", pairs[0])],
        [rp.Output(name, (name, "ground"), quantity) for name in ("a", "b")],
    )


def measured(model, noise=0.02, seed=0, lines=LINES, told=False):
    """Return the model's response with noise, a share of each pair's mean size.

    Returns
    -------
    xarray.DataArray
        With the variance beside it if it is `told`.
    """
    true = model.frequency_response(lines)
    level = noise * np.abs(true.values).mean(axis=0)
    rng = np.random.default_rng(seed)
    both = rng.standard_normal((2, *true.shape)) / np.sqrt(2)
    beside = {"variance": np.broadcast_to(level**2, true.shape)} if told else {}
    return labelled_response(
        lines,
        true.values + level * (both[0] + 1j * both[1]),
        model.output_names,
        model.input_names,
        true["units"].values,
        beside=beside,
    )
