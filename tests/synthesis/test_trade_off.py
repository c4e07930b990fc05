"""One design for each price on u."""

import numpy as np
import pytest

import robustpolish as rp


def lag():
    """X' = -x + u + w, z = x."""
    return rp.GeneralizedPlant.from_matrices([[-1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])


def test_h2_state_feedback_of_a_lag_in_closed_form():
    weights = np.array([0.2, 1.0, 5.0])
    found = rp.trade_off(lag(), weights, norm="h2").dataset
    # u = (1 - s) x with s = sqrt(1 + 1 / weight^2); x has the square norm 1 / (2 s).
    s = np.sqrt(1 + 1 / weights**2)
    np.testing.assert_allclose(found.performance, np.sqrt(1 / (2 * s)), rtol=1e-4)
    np.testing.assert_allclose(found.effort, (s - 1) * np.sqrt(1 / (2 * s)), rtol=1e-4)
    np.testing.assert_allclose(found.largest_gain, s - 1, rtol=1e-4)
    np.testing.assert_allclose(found.fastest_pole, s / (2 * np.pi), rtol=1e-4)


def test_the_weights_come_in_order_and_each_once():
    found = rp.trade_off(lag(), [1.0, 0.2, 1.0], norm="h2").dataset
    assert found.control_weight.values.tolist() == [0.2, 1.0]


def test_workers_find_the_same_to_the_last_bit():
    alone = rp.trade_off(lag(), [0.5, 1.0, 2.0])
    shared = rp.trade_off(lag(), [0.5, 1.0, 2.0], executor=None, progress=False)
    assert alone.norm == "hinf"
    assert alone.dataset.identical(shared.dataset)


def test_a_price_without_a_design_says_why(tmp_path):
    file = tmp_path / "curve.zip"
    found = rp.trade_off(lag(), [0.1, 10.0], norm="h2", gamma=0.4, file=file)
    assert [bool(reason) for reason in found.dataset.failure.values] == [False, True]
    assert np.isfinite(found.dataset.performance.values).tolist() == [True, False]
    assert "10: InfeasibleError" in str(found)
    assert found.plot().get_legend_handles_labels()[1] == ["weight 0.1"]
    again = rp.trade_off(lag(), [0.1, 10.0], norm="h2", gamma=0.4, file=file)
    assert again.dataset.identical(found.dataset)


def test_where_no_price_has_a_design_all_figures_are_missing():
    found = rp.trade_off(lag(), [10.0], norm="h2", gamma=1e-3)
    assert np.isnan(found.dataset.effort.values).all()
    assert not found.plot().get_legend_handles_labels()[1]


def test_discrete_output_feedback():
    plant = rp.GeneralizedPlant.from_matrices(
        [[0.9]], [[1.0, 0.0]], [[1.0]], [[1.0]], [[1.0]], D21=[[0.0, 1.0]], dt=0.1
    )
    found = rp.trade_off(plant, [0.1, 1.0], rp.output_feedback).dataset
    assert (found.performance.diff("control_weight") > 0).all()
    assert (found.effort.diff("control_weight") < 0).all()
    assert (found.fastest_pole > 0).all()


@pytest.mark.parametrize("weights", [0.0, [-1.0], [np.nan], [[1.0]]])
def test_weights_that_are_none_are_refused(weights):
    with pytest.raises(rp.InvalidInputError, match="control_weights"):
        rp.trade_off(lag(), weights)


def test_one_weight_among_the_settings_is_refused():
    with pytest.raises(rp.InvalidInputError, match="control_weights="):
        rp.trade_off(lag(), [1.0], control_weight=2.0)
