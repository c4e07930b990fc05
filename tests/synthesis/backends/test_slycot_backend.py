"""SLICOT's routines in a process of their own: published optima, and ends in time."""

import importlib.util
import time

import control
import numpy as np
import pytest
from published_plants import scherer_1997, zhou_h2

import robustpolish as rp
from robustpolish.synthesis.backends import slycot_backend
from robustpolish.synthesis.backends.slycot_backend import synthesise


def answer(routine, plant, time_limit=30.0):
    whole = (
        plant.A,
        np.hstack([plant.B1, plant.B2]),
        np.vstack([plant.C1, plant.C2]),
        np.block([[plant.D11, plant.D12], [plant.D21, plant.D22]]),
    )
    return synthesise(routine, (plant.nx, plant.nu, plant.ny), whole, time_limit)


@pytest.mark.parametrize(
    ("routine", "plant", "norm", "optimum"),
    [("SB10AD", scherer_1997(), "hinf", 9.51), ("SB10HD", zhou_h2(), "h2", 8.9582)],
)
def test_published_optima(routine, plant, norm, optimum):
    pytest.importorskip("slycot")
    found = answer(routine, plant)
    assert found.message == ""
    assert found.controller is not None
    assert found.gamma is None if norm == "h2" else found.gamma == pytest.approx(optimum, rel=5e-4)
    loop = rp.certify(plant, control.StateSpace(*found.controller), norm)
    assert loop.achieved == pytest.approx(optimum, rel=5e-4)


def test_a_refusal_and_the_end_of_the_time_are_told():
    pytest.importorskip("slycot")
    quiet = scherer_1997().replace(D21=np.zeros((1, 1)))  # a measurement without noise
    for routine, limit, told in (
        ("SB10HD", 30.0, "SB10HD refused: "),
        ("SB10AD", 1e-3, "SB10AD was ended after 0.001 s"),
        ("SB10AD", 0.0, "no time was left for SB10AD"),
    ):
        start = time.monotonic()
        found = answer(routine, quiet, limit)
        assert time.monotonic() - start < 20  # SB10AD would not end by itself
        assert found.controller is None
        assert found.message.startswith(told)


def test_missing_slycot_says_what_to_install(monkeypatch):
    def found(name, *rest):
        return None if name == "slycot" else importlib.util.find_spec(name, *rest)

    monkeypatch.setattr(slycot_backend, "find_spec", found)
    with pytest.raises(rp.errors.MissingDependencyError, match="pip install slycot"):
        answer("SB10AD", scherer_1997())
