"""Measure how singular I - XY becomes for the thesis's plant: the figures of the theory page.

Run with ``python docs/measure_singularity.py``.
"""

import control
import numpy as np

import robustpolish as rp
from robustpolish.base.budget import Budget
from robustpolish.synthesis.lmi.output_feedback import (
    LmiVariables,
    bounded_real,
    coupling,
    loop_terms,
    reconstruct,
)
from robustpolish.synthesis.lmi.program import Affine, ProgramSolver, SemidefiniteProgram
from robustpolish.synthesis.problem.matrices import Controller, PlantMatrices, close
from robustpolish.synthesis.problem.preflight import (
    decoupled_parts,
    scale_plant,
    with_control_penalty,
    with_measurement_noise,
)
from robustpolish.synthesis.structured.starts import Specification, mixed_start

SOLVER = ProgramSolver("cvxpy", None, Budget(), accuracy=1e-8)


def norm_of(plant, K):
    """Return the norm that a controller achieves, infinite where it does not stabilise."""
    if K is None:
        return np.inf
    inner = PlantMatrices.of(plant).without_d22()
    return float(rp.hinf_norm(control.StateSpace(*close(inner, K))))


def stated(plant, level=None):
    """State the inequalities of the H-infinity norm, whose square `level` fixes."""
    inner, program = PlantMatrices.of(plant).without_d22(), SemidefiniteProgram()
    v = LmiVariables.of(program, inner, "hinf")
    square = program.scalar() if level is None else Affine.of(level)
    coupling(program, v)
    program.positive(-bounded_real(loop_terms(inner, v), square))
    return program, v, square


def report(label, scale, plant, program, variables):
    """Solve one program and print how well its controller can be reconstructed."""
    solution = SOLVER.solve(program)
    if solution.x is None:
        print(f"  {label}: no answer ({solution.status})")
        return
    values = variables.at(solution)
    sizes = np.linalg.svd(np.eye(plant.nx) - values.X @ values.Y, compute_uv=False)
    K = reconstruct(PlantMatrices.of(plant).without_d22(), values)
    print(
        f"  {label}: singular values of I - XY {sizes[-1]:.1e} to {sizes[0]:.1e}, largest "
        f"controller entry {np.inf if K is None else K.gain:.1e}, "
        f"norm {scale(norm_of(plant, K)):.3e}"
    )


def main():
    """Print the figures for both actuations, with and without price and noise."""
    for actuation in ("displacement", "force"):
        for weight in (0.0, 1e-8):
            whole = rp.air_bearing(actuation=actuation, measured="displacement")
            part = decoupled_parts(
                with_measurement_noise(with_control_penalty(whole, weight), weight)
            )[0].plant
            ranks = [int(np.linalg.matrix_rank(D)) for D in (part.D12, part.D21)]
            print(f"{actuation}, price and noise {weight:g}: ranks of D12 and D21 {ranks}")
            scaled = scale_plant(part)
            choices = [("x axis, scaled", scaled.norm, scaled.plant)]
            if weight == 0:
                choices.append(("x axis, in SI units", float, part))
            for label, scale, plant in choices:
                program, variables, level = stated(plant)
                program.minimise(level)
                report(f"{label}, smallest gamma", scale, plant, program, variables)
            P = scaled.plant
            nothing = np.zeros((P.nx, P.ny)), np.zeros((P.nu, P.nx)), np.zeros((P.nu, P.ny))
            start = norm_of(P, Controller(-np.eye(P.nx), *nothing))
            for share in (1e-1, 1e-3):
                program, variables, _ = stated(P, (share * start) ** 2)
                program.minimise(variables.X.trace + variables.Y.trace)
                text = f"scaled, gamma {share:g} of the open loop, smallest trace"
                report(text, scaled.norm, P, program, variables)
            found = mixed_start([Specification(P, "hinf", None)], (), SOLVER, 1.05)
            n = P.nx
            K = Controller(found[:n, :n], found[:n, n:], found[n:, :n], found[n:, n:])
            print(
                "  scaled, 5 % above the smallest gamma, small variables, I - XY far from "
                f"singular: largest entry {K.gain:.1e}, "
                f"norm {scaled.norm(norm_of(P, K)):.3e}"
            )


if __name__ == "__main__":
    main()
