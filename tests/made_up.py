"""Results that no computation made, for tests of what becomes of results."""

import json
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
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.mechanical.parts import Damper, Dof, Input, Output, Spring
from robustpolish.polishing.ideal import BrushDesign
from tests.effects.learned_curves import learned_law_of

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
    told, law = diagnosis(), learned_law_of(lambda q: 4e9 * q**5, -0.01, 0.01, 9, at=PLACE)
    effect = law.effect
    keys = [f"effect[1].c{j + 1}" for j in range(9)]
    numbers = {name: Value(v, 0.1, "N") for name, v in effect.values.items()}
    return replace(
        told,
        verdict="unknown_law",
        model=replace(told.model, effects=(*told.model.effects, effect)),
        effects=(*told.effects, FoundEffect(effect.kind, effect.at, numbers)),
        covariance=xr.DataArray(
            np.array(law.covariance), {"parameter": keys, "other": keys}, ("parameter", "other")
        ),
    )


def edited(result, path, change):
    """Save a result, change what stands in its file, and return the path."""
    result.save(path)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    return path
