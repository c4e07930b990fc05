"""Models fitted to frequency responses."""

import numpy as np
import pytest

import robustpolish as rp
from tests.identification.frequency.chains import LINES, measured, two_masses

STARTS = [(0.7, 0.7), (0.7, 1.3), (1.3, 0.7), (1.3, 1.3)]


def started(model, shares, damping=0.3):
    values = model.parameters
    changes = {f"spring[{i}].stiffness": values[f"spring[{i}].stiffness"] * share
               for i, share in enumerate(shares)}  # fmt: skip
    changes |= {key: damping * value for key, value in values.items() if "damping" in key}
    return model.with_parameters(changes)


@pytest.mark.parametrize("quantity", ["displacement", "acceleration"])
@pytest.mark.parametrize("shares", STARTS)
def test_springs_that_are_30_percent_off_come_out(quantity, shares):
    model = two_masses(quantity)
    fitted = rp.refit(started(model, shares), measured(model))
    for key, error in fitted.stderr.items():
        assert abs(fitted.model.parameters[key] - model.parameters[key]) < 4 * error
        assert error < 0.01 * model.parameters[key]
    assert fitted.undetermined == ()


@pytest.mark.long
def test_intervals_cover_the_truth():
    model = two_masses()
    inside = []
    for seed in range(12):
        fitted = rp.refit(model, measured(model, 0.05, seed, told=bool(seed % 2)))
        for key, error in fitted.stderr.items():
            inside.append(abs(fitted.model.parameters[key] - model.parameters[key]) < 1.96 * error)
    assert 0.85 <= np.mean(inside) <= 1.0


@pytest.mark.long
def test_a_fit_never_ends_above_its_start():
    lacking = two_masses().with_effect(
        "attached_resonator", "b", {"mass": 0.2, "stiffness": 3e4, "damping": 1.0}
    )
    data = measured(lacking)
    rng = np.random.default_rng(1)
    for _ in range(4):
        values = two_masses().parameters
        shares = np.exp(0.3 * rng.standard_normal(len(values)))
        keys = [key for key in values if "gain" not in key]
        start = two_masses().with_parameters({
            key: values[key] * share for key, share in zip(keys, shares, strict=False)
        })  # fmt: skip
        fitted = rp.refit(start, data)
        before, after = (rp.compare(m, data).relative for m in (start, fitted.model))
        assert after <= before
        again = rp.compare(rp.refit(fitted.model, data).model, data).relative
        assert again <= after


def test_linear_effects_are_fitted_and_others_left_open():
    true = (
        two_masses()
        .with_effect("input_delay", "F", {"delay": 1e-3})
        .with_effect("cubic_stiffness", ("a", "ground"), {"stiffness": 1e9})
    )
    start = true.with_parameters({"effect[0].delay": 2e-4, "spring[0].stiffness": 1.6e5})
    fitted = rp.refit(start, measured(true))
    assert fitted.model.parameters["effect[0].delay"] == pytest.approx(1e-3, rel=0.01)
    assert fitted.undetermined == ("effect[1].stiffness",)
    assert fitted.model.parameters["effect[1].stiffness"] == 1e9


def test_a_record_over_time_is_fitted_by_its_response():
    model = two_masses(damping=40.0)
    time = np.arange(60000) * 1e-3
    rng = np.random.default_rng(0)
    force = rng.standard_normal(time.size)
    from robustpolish.linear.response import linear_response

    motion = linear_response(model.state_space(), time, force[:, None]).outputs
    motion = motion + 0.02 * motion.std(axis=0) * rng.standard_normal(motion.shape)
    import xarray as xr

    data = xr.Dataset(
        {"F": ("time", force, {"units": "N"}), "a": ("time", motion[:, 0], {"units": "m"}),
         "b": ("time", motion[:, 1], {"units": "m"})}, {"time": time},
    )  # fmt: skip
    response = rp.estimate_frequency_response(data, "F", ["a", "b"], segment=4.0)
    fitted = rp.refit(started(model, (0.7, 1.3)), response.sel(frequency=slice(5, 120)))
    for key in fitted.stderr:
        if "damping" not in key:
            assert fitted.model.parameters[key] == pytest.approx(model.parameters[key], rel=0.02)


@pytest.mark.long
def test_one_pair_and_missing_lines_are_enough():
    model = two_masses()
    data = measured(model).sel(output=["b"])
    data = data.where((data["frequency"] < 60) | (data["frequency"] > 65))
    fitted = rp.refit(started(model, (1.3, 1.3)), data)
    assert fitted.model.parameters["spring[0].stiffness"] == pytest.approx(2e5, rel=0.1)
    assert list(fitted.nrmse) == ["b/F"]
    assert LINES.size == data.sizes["frequency"]
