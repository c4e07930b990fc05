import numpy as np
import pytest
import xarray as xr
from scipy.integrate import solve_ivp

from robustpolish.identification import compare
from robustpolish.identification.fit.homotopy import free_rms, homotopy
from robustpolish.identification.fit.prepared import prepare
from robustpolish.identification.observer.kalman import FREE
from robustpolish.identification.policy import POLICY
from robustpolish.identification.record import record_of
from robustpolish.models import Damper, Dof, Input, MechanicalModel, Output, Spring
from tests.hidden_effects.cases import Case, model_of, one, records

PLACE = ("x", "ground")


def double_well(length):
    """Holmes' double well under a strong harmonic force, where runs part slowly."""
    time = np.arange(0, length, 0.05)
    force = 0.3 * np.cos(1.2 * time)

    def rhs(t, s):
        return [s[1], 0.3 * np.cos(1.2 * t) - 0.15 * s[1] + s[0] - s[0] ** 3]

    x = solve_ivp(rhs, (0, length), [1.0, 0.0], t_eval=time, rtol=1e-9, atol=1e-11).y[0]
    x += 0.01 * np.random.default_rng(0).standard_normal(time.size)
    model = MechanicalModel(
        [Dof("x", 1.0)],
        [Spring(PLACE, -1.0)],
        [Damper(PLACE, 0.15)],
        [Input("F", PLACE)],
        [Output("x", PLACE)],
    ).with_effect("cubic_stiffness", PLACE, {"stiffness": 1.0})
    return model, xr.Dataset({"F": ("time", force), "x": ("time", x)}, {"time": time})


@pytest.mark.parametrize("length", [50, 66, 74, 100])
def test_comparison_and_diagnosis_agree_on_what_is_reproducible(length):
    model, data = double_well(length)
    prepared = prepare(model, record_of(model, data), POLICY)
    calm = free_rms(model, prepared, prepared.everything)[1]
    assert calm == compare(model, data).reproducible


def test_the_number_of_processors_changes_no_bit(monkeypatch):
    case = Case("cubic", one(), [("cubic_stiffness", PLACE, [4e6])], drive=8.0, samples=1500)
    (data, _), _ = records(case)
    model = model_of(case).with_effect("cubic_stiffness", PLACE, {"stiffness": 3e6})
    prepared = prepare(model, record_of(model, data), POLICY)
    found = []
    for processors in (1, 7):
        monkeypatch.setattr("os.cpu_count", lambda processors=processors: processors)
        fits = homotopy(model, prepared, prepared.everything, model, (FREE,), 3)
        found.append((fits[-1].model.parameters, fits[-1].cost))
    assert found[0] == found[1]
    assert found[0][0]["effect[0].stiffness"] == pytest.approx(4e6, rel=0.05)
