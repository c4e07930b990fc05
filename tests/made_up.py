"""Results that no computation made, for tests of what becomes of results."""

from dataclasses import replace

import numpy as np
import xarray as xr

import robustpolish as rp
from robustpolish.identification.diagnosis import Diagnosis
from robustpolish.identification.findings import (
    FoundEffect,
    IndistinguishablePair,
    Ledger,
    RankedCandidate,
    Value,
)
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.effects.spline_law import learned_name, spline_basis
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from robustpolish.polishing.ideal import BrushDesign

PLACE = ("x", "ground")


def model() -> MechanicalModel:
    return MechanicalModel(
        dofs=[Dof("x", 2.0)],
        springs=[Spring(PLACE, 8e4)],
        dampers=[Damper(PLACE, 12.0)],
        inputs=[Input("F", PLACE)],
        outputs=[Output("x", PLACE)],
        spin_frequency=31.0,
        name="slide",
    )


def diagnosis() -> Diagnosis:
    force = Value(3.1, 0.02, "N")
    time = np.arange(500) / 1e3
    return Diagnosis(
        verdict="missing_effect",
        model=model().with_effect("coulomb_friction", PLACE, {"force": 3.1}),
        effects=(FoundEffect("coulomb_friction", PLACE, {"force": force}),),
        candidates=(
            RankedCandidate("coulomb_friction", PLACE, 0.02, 812.5, 1, {"force": 3.1}),
            RankedCandidate("quadratic_damping", PLACE, np.inf, 9.1, 1, {}, "not sensible"),
        ),
        indistinguishable=(
            IndistinguishablePair(
                Effect("coulomb_friction", PLACE),
                Effect("stribeck_friction", PLACE),
                "Move slowly, <1 mm/s, and change the speed.",
            ),
        ),
        ledger=Ledger(noise_floor={"x": 0.01})
        .add("base", {"x": 0.5})
        .add("refit", {"x": 0.31})
        .add("coulomb_friction", {"x": 0.0123456789}),
        missing_force=0.1 * np.random.default_rng(1).standard_normal((1, time.size)),
        sites=(PLACE,),
        parameters={"dof.x.mass": Value(2.0, 0.001, "kg"), "effect[0].force": force,
                    "spring[0].stiffness": Value(8e4, np.inf, "N/m")},
        reasons=("The effects explain 99 % of the error above the noise.",),
        time=time,
    )  # fmt: skip


def brush_design() -> BrushDesign:
    """Springs of 1e6 N/m at every mass, under a step of 10 N; no synthesis and no brush."""
    plant = rp.air_bearing(actuation="force")
    controller = rp.given_controller(plant, np.kron(np.eye(6), [[-1e6, -20.0]]))
    forces = {"F_x": 0.0, "F_y": 10.0, "F_z": 10.0, "F_p": 10.0}
    load = xr.Dataset(
        {name: ("time", np.full(1001, force), {"units": "N"}) for name, force in forces.items()},
        {"time": np.arange(1001) / 20e3},
        {"simulator": "a step"},
    )
    return BrushDesign(
        plant=plant,
        parameters=rp.polishing.AirBearingParameters(),
        disturbance=load,
        design=controller,
        control_weight=None,
        gain_bound=2e6,
        open_loop_norm=rp.hinf_norm(plant.open_loop),
        closed_loop_norm=rp.hinf_norm(plant.state_feedback_loop(controller.controller.D)),
        comparison=rp.compare_controllers(
            {"with control": controller}, load, plant=plant, signals=("x", "y", "z")
        ),
    )


def unknown_law() -> Diagnosis:
    """The diagnosis with friction and a hardening law, 4e9 q^5 in N, that nobody has named."""
    told, knots, q = diagnosis(), 9, np.linspace(-0.01, 0.01, 800)
    basis = spline_basis(q, -0.01, 0.01, knots)
    c = np.linalg.lstsq(basis.T, 4e9 * q**5, rcond=None)[0]
    error = 0.002 * 4e9 * 0.01**5
    c = c + error * np.random.default_rng(0).standard_normal(knots)
    values = {f"c{j + 1}": float(value) for j, value in enumerate(c)}
    effect = Effect(learned_name("stiffness", knots), PLACE, {"low": -0.01, "high": 0.01, **values})
    keys = [f"effect[1].{name}" for name in values]
    found = FoundEffect(
        effect.kind, effect.at, {name: Value(v, 0.1, "N") for name, v in effect.values.items()}
    )
    return replace(
        told,
        verdict="unknown_law",
        model=replace(told.model, effects=(*told.model.effects, effect)),
        effects=(*told.effects, found),
        covariance=xr.DataArray(
            error**2 * np.eye(knots), {"parameter": keys, "other": keys}, ("parameter", "other")
        ),
    )
