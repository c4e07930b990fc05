"""Measure how singular I - XY becomes for the thesis's plant: the figures of the theory page.

Run with ``python docs/measure_singularity.py``.
"""

import numpy as np

from robustpolish.polishing.air_bearing import air_bearing
from robustpolish.synthesis.lmi.mixed import (
    Specification,
    mixed_program,
    mixed_start,
    reconstructed,
)
from robustpolish.synthesis.nonsmooth.measures import HinfMeasure
from robustpolish.synthesis.problem.matrices import PlantMatrices, augmented
from robustpolish.synthesis.problem.preflight import with_control_penalty, with_measurement_noise
from robustpolish.synthesis.problem.scaling import decoupled_parts, scale_plant


def norm_of(plant, K):
    """Return the norm that a controller achieves, infinite where it does not stabilise."""
    if K is None:
        return np.inf
    pieces = HinfMeasure(augmented(PlantMatrices.of(plant), plant.nx)).pieces(K, 0.0, ())
    return pieces[0].value if pieces else np.inf


def report(label, scale, plant, program, variables):
    """Solve one program and print how well its controller can be reconstructed."""
    solution = program.solve(tolerance=1e-8)
    if solution.x is None:
        print(f"  {label}: no answer ({solution.status})")
        return
    X, Y = solution.value(variables.X), solution.value(variables.Y)
    sizes = np.linalg.svd(np.eye(plant.nx) - X @ Y, compute_uv=False)
    K = reconstructed(plant, variables, solution)
    entry = np.inf if K is None else np.abs(K).max()
    print(
        f"  {label}: singular values of I - XY {sizes[-1]:.1e} to {sizes[0]:.1e}, "
        f"largest controller entry {entry:.1e}, norm {scale(norm_of(plant, K)):.3e}"
    )


def main():
    """Print the figures for both actuations, with and without price and noise."""
    for actuation in ("displacement", "force"):
        for weight in (0.0, 1e-8):
            whole = air_bearing(actuation=actuation, measured="displacement")
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
                specification = [Specification(plant, "hinf", None)]
                program, variables, level = mixed_program(specification, (), None)
                program.minimise(level)
                report(f"{label}, smallest gamma", scale, plant, program, variables)
            P = scaled.plant
            rest = np.zeros((P.nx + P.nu, P.nx + P.ny))
            rest[: P.nx, : P.nx] = -np.eye(P.nx)
            start = norm_of(P, rest)
            for share in (1e-1, 1e-3):
                fixed = [Specification(P, "hinf", share * start)]
                program, variables, _ = mixed_program(fixed, (), None)
                program.minimise(variables.X.trace + variables.Y.trace)
                text = f"scaled, gamma {share:g} of the open loop, smallest trace"
                report(text, scaled.norm, P, program, variables)
            K = mixed_start([Specification(P, "hinf", None)], (), np.inf)
            print(
                "  scaled, 5 % above the smallest gamma, small variables, I - XY far from "
                f"singular: largest entry {np.abs(K).max():.1e}, "
                f"norm {scaled.norm(norm_of(P, K)):.3e}"
            )


if __name__ == "__main__":
    main()
