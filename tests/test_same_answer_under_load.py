"""Designs, diagnoses and the demo are the same, bit by bit, on a busy machine and many threads."""

import json

import pytest

from .busy import busy_machine, output_of

BUSY = 14

# The 24 benchmark plants: easy ones, and those whose searches used to end with the clock.
PLANTS = """
import json, os
import numpy as np
import robustpolish as rp

data = np.load(os.environ["PLANTS"])
answers = {}
for name in sorted({key.split("/")[0] for key in data}):
    keys = ("A", "B1", "B", "C1", "C", "D11", "D12", "D21")
    plant = rp.GeneralizedPlant.from_matrices(*(data[f"{name}/{key}"] for key in keys))
    try:
        design = rp.output_feedback(plant)
    except rp.InfeasibleError as error:
        answers[name] = str(error)
        continue
    K = design.controller
    answers[name] = {
        "status": design.status,
        "achieved": float(design.certificate.achieved).hex(),
        "bound": float(design.certificate.bound).hex(),
        **{key: [x.hex() for x in np.ravel(getattr(K, key)).tolist()] for key in "ABCD"},
    }
print(json.dumps(answers))
"""

# Hidden cases: one effect, two effects, friction with memory, nothing missing.
DIAGNOSES = """
import json
from dataclasses import replace
import robustpolish as rp
from tests.hidden_effects.cases import model_of, records
from tests.hidden_effects.catalogue import all_cases

chosen = ("quadratic damping", "cubic and coulomb", "lugre, one mass", "nothing, one mass")
answers = {}
for case in all_cases():
    if case.name in chosen:
        case = replace(case, samples=5000)
        (data, _), _ = records(case)
        found = rp.diagnose(model_of(case), data)
        answers[case.name] = {
            "verdict": found.verdict,
            "effects": [str(effect) for effect in found.effects],
            **{key: [v.value.hex(), v.stderr.hex()] for key, v in found.parameters.items()},
        }
assert len(answers) == len(chosen), list(answers)
print(json.dumps(answers))
"""
DEMO = """
import json
import numpy as np
import robustpolish as rp

found = rp.polishing.design_against_brush(duration=0.5, realisation="ideal")
arrays = {
    "gain": found.design.controller.D,
    "norm": found.closed_loop_norm.value,
    **{name: column.values for name, column in found.comparison.table.items()},
    **{
        f"{name}: {signal}": values.values
        for name, response in found.comparison.responses.items()
        for signal, values in response.items()
    },
}
print(json.dumps({key: np.asarray(value).tobytes().hex() for key, value in arrays.items()}))
"""
STATE_FEEDBACK = """
import json
import numpy as np
import robustpolish as rp

rng = np.random.default_rng(4)
A, B1, B2 = rng.normal(size=(4, 4)), rng.normal(size=(4, 2)), rng.normal(size=(4, 2))
small = rp.GeneralizedPlant.from_matrices(A, B1, B2, rng.normal(size=(2, 4)), np.eye(4))
bearing = rp.air_bearing(actuation="force")
calls = ((bearing, {"control_weight": 1e-7}), (bearing, {}), (small, {"gain_bound": 6.0}))
designs = [rp.state_feedback(plant, **options) for plant, options in calls]
answers = [[d.certificate.achieved.hex(), d.gain.tobytes().hex()] for d in designs]
print(json.dumps(dict(enumerate(answers))))
"""
SCRIPTS = {"state feedback": STATE_FEEDBACK, "plants": PLANTS, "diagnoses": DIAGNOSES, "demo": DEMO}


def answers(name, shared, threads=1):
    """Return the numbers of a script, to the last bit."""
    plants = str(shared / "data" / "compleib" / "compleib24.npz")
    return json.loads(output_of(SCRIPTS[name], threads=threads, PLANTS=plants))


@pytest.fixture(scope="module")
def alone(shared):
    """The answers of every script on a machine that does nothing else, on one thread."""
    return {name: answers(name, shared) for name in SCRIPTS}


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", SCRIPTS)
def test_fourteen_busy_processes_change_no_bit(alone, shared, name):
    with busy_machine(BUSY):
        busy = answers(name, shared)
    assert [key for key in alone[name] if alone[name][key] != busy[key]] == []


@pytest.mark.long
@pytest.mark.shared
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("name", SCRIPTS)
def test_any_number_of_threads_gives_the_same_bits(alone, shared, name):
    four = answers(name, shared, threads=4)
    assert [key for key in alone[name] if alone[name][key] != four[key]] == []
