"""Try every method on the 24 COMPleib plants and write docs/compleib_table.md.

Run with ``make compleib``; it reads ../shared/data/compleib and takes some minutes. Every
controller is judged by the loop alone: closed again, its poles and its norm computed afresh.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from pathlib import Path

import control
import numpy as np

import robustpolish as rp
from benchmarks.plain_lmi import plain_lmi_cvxpy, plain_lmi_picos
from robustpolish.synthesis.backends.slycot_backend import synthesise
from robustpolish.synthesis.lmi.program import run_with_time_limit

ROOT = Path(__file__).parents[1]
DATA = ROOT.parent / "shared" / "data" / "compleib" / "compleib24.npz"
PAGE = ROOT / "docs" / "compleib_table.md"
SECONDS = 10.0

# Infimum of the full-order H-infinity norm; 0 is approached only, None: not stabilisable.
INFIMUM = {
    "AC1": 0.0, "AC3": 2.96740, "AC4": 0.557292, "AC6": 3.4273, "AC8": 1.61648, "AC12": 0.0,
    "AC15": 14.8628, "HE1": 0.0736154, "HE2": 2.41813, "HE4": 22.8382, "REA1": 0.861721,
    "REA4": None, "DIS5": 666.271, "TG1": 3.46524, "BDT1": 0.266212, "EB1": 3.10408, "UWV": 0.0,
    "PSM": 0.920243, "NN2": 1.76438, "NN7": 33.0389, "HF2D11": 76443.3, "HF2D18": 93.1532,
    "ROC6": 21.5279, "FS": 77918.8,
}  # fmt: skip

INTRODUCTION = """\
# Methods of H-infinity output feedback on 24 benchmark plants

24 of the plants of COMPleib (F. Leibfritz, 2004), small and nasty: most have rank-deficient D12
or D21. Written by `make compleib`; every controller is judged from its loop, whatever its solver
said.

**right**: stable and within 1 % of the infimum (at most 1e-3 where it is 0; where no controller
exists, a refusal). **off**: stable, and not within 1 %. **false**: stable, and the claimed gamma
is below the norm. **unstable**: the loop is. **refused**: an error, no answer within 10 s, or no
number. "ours" is `rp.output_feedback`, "SB10AD" SLICOT's routine on the plant as it is (gamma from
1e10), "plain LMI" the textbook inequalities typed into cvxpy (Clarabel) and picos (CVXOPT).
"""

Answer = tuple[control.StateSpace, float | None]


def ours(method: str) -> Callable[[rp.GeneralizedPlant], Answer]:
    """Return our synthesis by one method."""

    def run(plant: rp.GeneralizedPlant) -> Answer:
        design = rp.output_feedback(plant, method=method)
        return design.controller, design.certificate.claimed

    return run


def sb10ad(plant: rp.GeneralizedPlant) -> Answer:
    """Call SB10AD on the plant as it is."""
    system = plant.system
    sizes = (plant.nx, plant.nu, plant.ny)
    answer = synthesise("SB10AD", sizes, (system.A, system.B, system.C, system.D), 0.9 * SECONDS)
    if answer.controller is None:
        raise rp.SolverError(answer.message)
    return control.StateSpace(*answer.controller), answer.gamma


METHODS: dict[str, Callable[[rp.GeneralizedPlant], Answer]] = {
    "ours": ours("auto"),
    "ours, LMI": ours("lmi"),
    "ours, SLICOT": ours("slycot"),
    "SB10AD": sb10ad,
    "plain LMI, cvxpy": plain_lmi_cvxpy,
    "plain LMI, picos": plain_lmi_picos,
}


def judge(plant: rp.GeneralizedPlant, infimum: float | None, solve: Callable) -> tuple:
    """Return verdict, ratio to the infimum (or the norm, if that is 0), gain and seconds."""

    def attempt() -> tuple:
        try:
            K, claimed = solve(plant)
            return "answer", tuple(map(np.asarray, (K.A, K.B, K.C, K.D))), claimed
        except rp.InfeasibleError:
            return ("infeasible",)
        except Exception as error:
            return "refused", type(error).__name__

    start = time.perf_counter()
    outcome = run_with_time_limit(attempt, SECONDS) or ("refused", "time")
    seconds = time.perf_counter() - start
    if outcome[0] != "answer":
        right = outcome[0] == "infeasible" and infimum is None
        return "right" if right else "refused", np.nan, np.nan, seconds
    parts, claimed = outcome[1:]
    gain = max(float(np.max(np.abs(M), initial=0)) for M in parts)
    if not np.isfinite(gain):
        return "refused", np.nan, np.nan, seconds
    found = rp.hinf_norm(plant.closed_loop(control.StateSpace(*parts)))
    if not np.isfinite(found.value):
        return "unstable", np.nan, gain, seconds
    achieved = found.value / infimum if infimum else found.value
    limit = 1.01 if infimum else 1e-3
    if claimed is not None and found.value > 1.001 * claimed + (0 if infimum else 1e-3):
        return "false", achieved, gain, seconds
    return "right" if achieved <= limit else "off", achieved, gain, seconds


def main() -> None:
    """Run all methods on all plants and write the page."""
    if not DATA.is_file():
        sys.exit(f"{DATA} is not here: the benchmark plants are not part of this project.")
    data = np.load(DATA)
    rows, counts = [], {name: [] for name in METHODS}
    for name, infimum in INFIMUM.items():
        matrices = [data[f"{name}/{key}"] for key in ("A", "B1", "B", "C1", "C")]
        direct = [data[f"{name}/{key}"] for key in ("D11", "D12", "D21")]
        plant = rp.GeneralizedPlant.from_matrices(*matrices, *direct)
        cells = [name, str(plant.nx), "none" if infimum is None else f"{infimum:g}"]
        for method, solve in METHODS.items():
            verdict, achieved, gain, seconds = judge(plant, infimum, solve)
            counts[method].append((verdict, seconds, gain))
            text = verdict
            if np.isfinite(achieved):
                text += f" {achieved:.4g}" if infimum else f" ({achieved:.1e})"
            cells.append(text)
        print(" | ".join(cells), flush=True)
        rows.append("| " + " | ".join(cells) + " |")
    head = ["plant", "states", "infimum", *METHODS]
    lines = [
        INTRODUCTION,
        "| method | right | off | false | unstable | refused | median seconds | median gain |",
        "|---|---:|---:|---:|---:|---:|---:|---:|",
    ]
    for method, found in counts.items():
        verdicts = [verdict for verdict, _, _ in found]
        tally = [
            str(verdicts.count(verdict))
            for verdict in ("right", "off", "false", "unstable", "refused")
        ]
        seconds = np.median([s for _, s, _ in found])
        gain = np.nanmedian([g for _, _, g in found])
        lines.append(f"| {method} | {' | '.join(tally)} | {seconds:.2f} | {gain:.2g} |")
    lines += [
        "",
        "Norm achieved divided by the infimum; in parentheses the norm itself, where that is 0:",
        "",
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
        *rows,
    ]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")
    print(f"Wrote {PAGE}")


if __name__ == "__main__":
    main()
