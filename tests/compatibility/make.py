"""What a version saves, to be loaded by all later ones: `python -m tests.compatibility.make`.

Run once for each version that is released, with that version, and never again: the files are what
users have on their disks.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import control

import robustpolish as rp
from tests import made_up
from tests.fuzz.files_corpus import corpus

HERE = Path(__file__).parent


def designs() -> dict[str, Any]:
    """Return designs of many methods, which keep different details."""
    double = rp.GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [0.0, 0.0]], [[0.0, 0.0], [1.0, 0.0]], [[0.0], [1.0]],
        [[1.0, 0.0], [0.0, 0.0]], [[1.0, 0.0]], D12=[[0.0], [1.0]], D21=[[0.0, 1.0]],
    )  # fmt: skip
    mass = rp.GeneralizedPlant.from_matrices(
        [[0.0, 1.0], [-100.0, 0.1]], [[0.0], [1.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[1.0, 0.0]],
        states=["x", "dx"],
    )  # fmt: skip
    discrete = rp.GeneralizedPlant.from_matrices(
        [[0.5]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], dt=0.05
    )
    lag = control.tf([1.0], [1.0, 1.0], inputs="F", outputs="x")
    weighted = rp.mixed_sensitivity(lag, performance=rp.weight(1e3, 0.5, 0.5), effort=0.05)
    s = control.tf("s")
    found = {
        "output_feedback": rp.output_feedback(double),
        "output_feedback_h2": rp.output_feedback(double, "h2"),
        "state_feedback": rp.state_feedback(mass, "h2", "riccati", control_weight=0.1),
        "pole_region": rp.state_feedback(
            mass, "h2", "lmi", control_weight=0.1, pole_region=rp.HalfPlane(-0.5)
        ),
        "observer_feedback": rp.observer_feedback(double, "h2"),
        "passive_feedback": rp.passive_feedback(
            mass, dampers=[("x", "ground")], damping_bound=30.0
        ),
        "given": rp.given_controller(discrete, [[-0.1]]),
        "tuned_blocks": rp.structured_output_feedback(
            weighted, [rp.tunable.pid("x", kind="PI", sign=-1)], target=0.6
        ),
        "loop_shaping": rp.loop_shaping(200 / ((10 * s + 1) * (0.05 * s + 1) ** 2), W1=(s + 2) / s),
    }
    found["sampled"] = found["output_feedback"].discretize(0.05, delay=0.01, anti_aliasing=5.0)
    return found


def main() -> None:
    """Write the folder of this version; refuse if there is one."""
    folder = HERE / rp.__version__
    folder.mkdir()
    told = {}
    for name, design in designs().items():
        design.save(folder / f"{name}.json")
        told[name] = {"achieved": design.certificate.achieved, "method": design.method}
    machine = rp.MechanicalModel.from_toml(corpus()["load/machine.toml"].decode())
    machine.to_toml(folder / "machine.toml")
    (folder / "wired.json").write_bytes(corpus()["load/wired.json"])
    made_up.diagnosis().save(folder / "diagnosis.json")
    replace(made_up.diagnosis(), model=machine, notes=("own effects",)).save(folder / "own.json")
    (folder / "told.json").write_text(json.dumps(told, indent=1) + "\n")


if __name__ == "__main__":
    main()
