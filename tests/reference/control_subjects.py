"""Answers of synthesis, norms, robustness, export and saved files."""

from __future__ import annotations

import hashlib
import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import control
import numpy as np
from scipy.io import loadmat

import robustpolish as rp

from . import examples as ex
from .plain import digest, fields, keys

Cases = Iterator[tuple[str, Callable[[], Any]]]

# The pairs of plant and method beside the automatic choice: those that take some seconds at most.
LMI = ("AC3", "AC4", "AC6", "AC8", "AC15", "HE1", "HE2", "REA1", "DIS5", "BDT1", "EB1", "PSM",
       "NN2", "HF2D11", "HF2D18", "ROC6", "FS")  # fmt: skip
SLYCOT = ("AC1", "AC4", "AC12", "AC15", "HE1", "REA4", "DIS5", "BDT1", "UWV", "PSM", "NN2")
STATIC = ("AC4", "NN2")


def designed(design: rp.results.Design) -> dict[str, Any]:
    """Return what is known of a design, but not how long it took.

    Where the safety net in seconds stopped the search, what it found depends on the machine.
    """
    if design.status == "time_limit":
        return {"status": design.status, "valid": design.certificate.valid}
    proof = fields(
        design.certificate,
        "norm valid reasons stable achieved claimed bound largest_gain peak_frequency poles",
    )
    told = fields(design, "status method backend norm message lower_bound")
    parts = [np.ravel(getattr(design.controller, name)) for name in "ABCD"]
    size = float(np.linalg.norm(np.concatenate(parts)))
    return told | {"certificate": proof, "controller": design.controller, "size": size}


def solved(
    plant: rp.GeneralizedPlant, solve: Callable[..., rp.results.Design], **options: Any
) -> Any:
    return designed(solve(plant, **options))


def plants() -> Cases:
    """Yield the 24 benchmark plants by the automatic choice, and by the methods that are quick."""
    for name, plant in ex.plants("compleib24.npz"):
        yield f"{name}, auto", partial(solved, plant, rp.output_feedback)
        if name in LMI:
            yield f"{name}, lmi", partial(solved, plant, rp.output_feedback, method="lmi")
        if name in SLYCOT:
            yield f"{name}, slycot", partial(solved, plant, rp.output_feedback, method="slycot")
        if name in STATIC:
            yield f"{name}, static", partial(solved, plant, rp.static_output_feedback)
        if name in ("AC4", "HE1", "NN2", "REA1"):
            yield f"{name}, h2", partial(solved, plant, rp.output_feedback, norm="h2")
            yield f"{name}, state", partial(solved, plant, rp.state_feedback)


def larger_plants() -> Cases:
    """Yield the ten larger benchmark plants, 16 to 120 states."""
    for name, plant in ex.plants("compleib_larger.npz"):
        yield f"{name}, auto", partial(solved, plant, rp.output_feedback)


def special_plants() -> Cases:
    """Yield the plant on which static output feedback went wrong once.

    The other one there is stopped by the clock, so that its answer depends on the machine.
    """
    yield "static_singular", _static_singular


def _static_singular() -> Any:
    with np.load(ex.DATA / "plants" / "static_singular.npz") as data:
        given = {key.split("/")[-1]: data[key] for key in data}
    names = {"B": "B2", "C": "C2"}
    matrices = {names.get(key, key): value for key, value in given.items()}
    plant = rp.GeneralizedPlant.from_matrices(**matrices)
    return designed(rp.static_output_feedback(plant))


def both_norms(system: control.StateSpace) -> dict[str, Any]:
    """Return both norms with their brackets."""
    hinf, h2 = rp.hinf_norm(system), rp.h2_norm(system)
    quick = rp.hinf_norm(system, exact=False)
    names = "value frequency lower upper stable reason"
    return {
        "hinf": fields(hinf, names),
        "quick": fields(quick, names),
        "h2": fields(h2, "value lower upper stable reason"),
    }


def shifted(system: control.StateSpace) -> control.StateSpace:
    """Return the system with its poles moved to the left until all are stable, just."""
    far = np.linalg.eigvals(system.A).real.max()
    move = max(far, 0.0) + 1e-4 * np.abs(np.linalg.eigvals(system.A)).max()
    return control.ss(system.A - move * np.eye(len(system.A)), system.B, system.C, system.D)


def norms() -> Cases:
    """Yield hard systems, the polishing robot and random systems of up to 60 states."""
    for seed in range(48):
        yield f"hard {seed}", lambda seed=seed: both_norms(ex.hard_system(seed))
    for share in (0.001, 0.01):
        robot = rp.air_bearing(dissipation=share).open_loop
        yield f"air bearing {share}", partial(both_norms, robot)
    for states in (12, 24, 60):
        rng = np.random.default_rng(states)
        A = rng.standard_normal((states, states))
        A -= (np.linalg.eigvals(A).real.max() + 0.05 * np.sqrt(states)) * np.eye(states)
        B, C = rng.standard_normal((states, 2)), rng.standard_normal((2, states))
        yield f"random {states}", partial(both_norms, control.ss(A, B, C, np.zeros((2, 2))))


def norms_of_plants() -> Cases:
    """Yield the norms of the benchmark plants, as they are and barely stable."""
    for file in ("compleib24.npz", "compleib_larger.npz"):
        for name, plant in ex.plants(file):
            yield name, partial(both_norms, plant.open_loop)
            if plant.nx <= 21:
                yield f"{name}, shifted", partial(both_norms, shifted(plant.open_loop))


def margin_of(found: Any) -> dict[str, Any]:
    """Return bounds, proof and witness of a robustness analysis."""
    names = ("lower", "upper", "status", "proven", "critical_frequency", "reason", "mu", "nominal")
    told = {name: getattr(found, name) for name in names if hasattr(found, name)}
    return told | {"intervals": len(found.intervals), "witness": found.witness}


def robust() -> Cases:
    """Yield public examples with published answers, and those of notebook 09."""
    for make in (ex.servo, ex.damper, ex.carts, ex.column):
        name = make.__name__
        yield f"{name}, stability", lambda make=make: margin_of(rp.robust_stability(make()))
        if make is not ex.damper:
            yield f"{name}, performance", lambda make=make: margin_of(rp.robust_performance(make()))
            yield f"{name}, gain", lambda make=make: margin_of(rp.worst_case_gain(make()))
    yield "coprime factors", _coprime
    for seed in range(700, 716):
        yield f"mu of a matrix {seed}", partial(_mu_of_matrix, seed)
    for name, ranges in NUMBERS.items():
        yield f"robot, {name}", partial(_robot, ranges)
    yield "machines that data allow", _from_data


def _coprime() -> Any:
    return margin_of(rp.structured_singular_value(ex.coprime_loop(), [("full", (2, 2))]))


def _mu_of_matrix(seed: int) -> Any:
    blocks, sizes, M = ex.blocks_and_matrix(seed)
    given = [("full", k) if kind == "full" else kind for kind, k in zip(blocks, sizes, strict=True)]
    return margin_of(rp.structured_singular_value(M, given))


NUMBERS = {
    "stiffness of the arm": {"spring[0].stiffness": 0.2},
    "stiffness of the joint": {"spring[1].stiffness": 0.2},
    "damping": {"damper[1].damping": 0.5},
    "mass of the tool": {"dof.tool.mass": 0.2},
    "contact": {"spring[2].stiffness": 0.9},
}
NUMBERS["all"] = {key: share for ranges in NUMBERS.values() for key, share in ranges.items()}


@cache
def _robot_design() -> rp.results.Design:
    robot = ex.robot()
    plant = replace(robot, inputs=robot.inputs[:1]).linearize(["arm"], measured="outputs")
    return rp.output_feedback(plant, control_weight=3e-5, measurement_noise=1e-6)


def _robot(ranges: dict[str, float]) -> Any:
    loop = (
        ex.robot().uncertain(ranges)[["tool", "tool"], ["F", "u"]].lft(_robot_design().controller)
    )
    return {
        "design": designed(_robot_design()),
        "stability": margin_of(rp.robust_stability(loop)),
        "gain": margin_of(rp.worst_case_gain(loop)),
    }


def _from_data() -> Any:
    """Go the way of notebook 09 from a record to a proof."""
    diagnosis = rp.diagnose(ex.slide(), ex.record(ex.hardening))
    machines = diagnosis.uncertain(0.95, ports=["effect[0]"])
    low, high = rp.uncertain.effect_sector(diagnosis, "effect[0]", 4e-3)
    springs = (*diagnosis.model.springs, rp.Spring(ex.PLACE, (low + high) / 2))
    middle = replace(diagnosis.model, effects=(), springs=springs)
    plant = middle.linearize(["x"], measured="outputs")
    design = rp.output_feedback(plant, control_weight=1e-3, measurement_noise=1e-5)
    around = machines[["x", "effect[0]", "x"], ["F", "effect[0]", "F"]].lft(design.controller)
    loop = rp.uncertain.UncertainSystem(
        around.matrices.names(["F", "effect[0]"], ["x", "effect[0]"])
    )
    margin = rp.robust_stability(loop)
    still = loop.feedback(np.diag([0.0, (low + high) / 2]))[["x"], ["F"]]
    sector = rp.robust_sector(loop, {"effect[0]": (low, high)})
    return {
        "verdict": diagnosis.verdict,
        "numbers": {k: [v.value, v.stderr] for k, v in diagnosis.parameters.items()},
        "sector": [low, high],
        "design": designed(design),
        "stability": margin_of(margin),
        "at the witness": loop.numbers(margin.witness),
        "with the spring": fields(sector, "lower stable"),
        "gain": margin_of(rp.worst_case_gain(still)),
    }


def exports() -> Cases:
    """Yield what two designs are exported as: C with vectors, MAT, JSON, FMU."""
    sampled = {
        "servo": lambda: ex.servo_design().discretize(0.05, delay=0.02),
        "two by two": lambda: ex.two_by_two().discretize(0.05),
        "servo, filtered": lambda: ex.servo_design().discretize(0.05, anti_aliasing=5.0),
    }
    for name, make in sampled.items():
        made = cache(make)
        yield f"{name}: certificate", partial(_certificate, made)
        for precision in ("double", "float"):
            yield f"{name}: C, {precision}", partial(_c, made, precision)
        yield f"{name}: MAT", partial(_mat, made)
        yield f"{name}: JSON", partial(_json, made)
        if shutil.which("cc"):
            yield f"{name}: FMU", partial(_fmu, made)


def _certificate(made: Callable[[], rp.results.SampledDesign]) -> Any:
    proof = made().certificate
    told = fields(proof, "valid achieved upper spectral_radius")
    return told | {"controller": made().controller}


def _c(made: Callable[[], rp.results.SampledDesign], precision: str) -> Any:
    path = made().export_c(
        "code.c", name="lag", precision=precision, limits=2.0, test_vectors=25, force=True
    )
    vectors = path.with_name("code_vectors.csv").read_text()
    numbers = np.array([line.split(",") for line in vectors.splitlines()[1:]], dtype=float)
    return {"bits": digest(path.read_bytes()), "lines": len(path.read_text().splitlines()),
            "vectors": numbers, "text of vectors": digest(vectors)}  # fmt: skip


def _mat(made: Callable[[], rp.results.SampledDesign]) -> Any:
    content = loadmat(made().export_mat("code.mat", limits=2.0, force=True))
    return {key: value for key, value in sorted(content.items()) if not key.startswith("__")}


def _json(made: Callable[[], rp.results.SampledDesign]) -> Any:
    text = made().export_json("code.json", limits=2.0, force=True).read_text()
    return {"bits": digest(text), "content": json.loads(text)}


def _fmu(made: Callable[[], rp.results.SampledDesign]) -> Any:
    """Hash the files inside; of what was compiled, only the name."""
    with zipfile.ZipFile(made().export_fmu("code.fmu", limits=2.0, force=True)) as archive:
        return {
            name: hashlib.sha256(archive.read(name)).hexdigest()[:20]
            if name.endswith((".xml", ".c", ".h"))
            else "there"
            for name in sorted(archive.namelist())
        }


def saved() -> Cases:
    """Yield what was saved by the first version and is loaded now, and what is saved now."""
    folder = ex.ROOT / "tests" / "compatibility" / "0.1.0"
    for path in sorted(folder.iterdir()):
        if path.stem != "told":
            yield path.name, partial(_loaded, path)
    for name, make in MADE_NOW.items():
        yield f"saved now: {name}", partial(_saved_now, make)


def _loaded(path: Path) -> Any:
    found = rp.load(path)
    told = {"type": type(found).__name__, "repr": _without_seconds(repr(found))}
    if isinstance(found, rp.results.Design):
        told |= designed(found) | {"details": sorted(found.details)}
    elif isinstance(found, rp.results.SampledDesign):
        told |= {"controller": found.controller} | fields(found.certificate, "valid achieved upper")
    elif isinstance(found, rp.results.Diagnosis):
        numbers = {key: [v.value, v.stderr] for key, v in found.parameters.items()}
        told |= {"verdict": found.verdict, "numbers": numbers}
        told |= {"explained": digest(found.explain())}
    elif isinstance(found, rp.GeneralizedPlant):
        told |= {"system": found.system, "names": _labels(found.system)}
    else:
        return told | {"text": found.to_toml()}
    return told | _saved_now(lambda: found)


def _labels(system: control.StateSpace) -> list[list[str]]:
    return [system.state_labels, system.input_labels, system.output_labels]


def _without_seconds(text: str) -> str:
    return "\n".join(line for line in text.splitlines() if not line.strip().startswith("seconds"))


def _saved_now(make: Callable[[], Any]) -> Any:
    """Save it, and return the structure of the file."""
    made = make()
    made.save("now.json", force=True)
    content = json.loads(Path("now.json").read_text())
    again = rp.load("now.json")
    return {"kind": content.get("kind"), "keys": keys(content), "again": type(again).__name__}


MADE_NOW: dict[str, Callable[[], Any]] = {
    "design": ex.servo_design,
    "given": ex.two_by_two,
    "sampled design": lambda: ex.servo_design().discretize(0.05, delay=0.01, anti_aliasing=5.0),
    "plant": rp.air_bearing,
    "state feedback": lambda: rp.state_feedback(rp.air_bearing().with_full_state(), "h2"),
}
