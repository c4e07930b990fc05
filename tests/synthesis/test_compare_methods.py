"""The comparison table holds certified numbers only."""

import matplotlib as mpl
import numpy as np
import pytest
from published_plants import benner_weak, scherer_1997

import robustpolish as rp
from robustpolish.synthesis.compare import compare_methods

mpl.use("Agg")


@pytest.fixture(scope="module")
def table():
    return compare_methods(scherer_1997(), time_limit=20.0)


def test_every_method_comes_close(table):
    assert [r.method for r in table] == ["auto", "riccati", "lmi/cvxpy", "lmi/picos", "slycot"]
    for result in table:
        assert result.achieved == pytest.approx(9.508, rel=0.01), result.message
        assert result.design.certificate.valid
        assert result.claimed >= result.achieved * (1 - 1e-3)
        assert 0 <= result.order <= 3
        assert result.gain > 0
        assert result.condition >= 1


def test_the_table_prints(table):
    text = str(table).splitlines()
    assert text[0].split() == [
        "part", "method", "status", "claimed", "achieved", "gain", "condition", "order", "seconds",
    ]  # fmt: skip
    assert len(text) == 6
    assert "<td>lmi/picos</td>" in table._repr_html_()
    assert len(table) == 5
    with pytest.raises(KeyError):
        table["newton"]


def test_the_plot_shows_bound_claim_and_norm_of_every_method(table):
    ax = table.plot()
    assert [label.get_text() for label in ax.get_yticklabels()] == [r.method for r in table]
    bounds, claims, norms = (line.get_xdata() for line in ax.lines)
    assert list(claims) == [r.claimed for r in table]
    assert list(norms) == [r.achieved for r in table]
    assert (bounds <= norms).all()


def test_each_part_is_compared_with_price_and_noise():
    # x' = a x + w + u, z = (x, u), y = x + v: X = Y and XY = gamma^2 at gamma = a + sqrt(a^2 + 2).
    one = np.eye(2)
    plant = rp.GeneralizedPlant.from_matrices(np.diag([1.0, 0.0]), one, one, one, one)
    asked = {"control_weight": [1.0, 1.0], "measurement_noise": 1.0}
    table = compare_methods(plant, ["riccati", "lmi/cvxpy"], **asked)
    assert [(r.part, r.method) for r in table] == [
        (part, method) for part in ("u1", "u2") for method in ("riccati", "lmi/cvxpy")
    ]
    for r in table:
        a = {"u1": 1.0, "u2": 0.0}[r.part]
        assert r.achieved == pytest.approx(a + np.sqrt(a**2 + 2), rel=4.1e-3)
        assert r.design is not None
        loop = r.design.plant.closed_loop(r.design.controller)
        assert rp.hinf_norm(loop).value == pytest.approx(r.achieved, rel=1e-6)
    assert table["u2", "riccati"].part == "u2"
    assert table.plot().get_yticklabels()[3].get_text() == "u2: lmi/cvxpy"
    with pytest.raises(rp.InvalidInputError, match=r"^control_weight: "):
        compare_methods(plant, control_weight=-1.0)
    # The parts have Pade models of a delay only, the whole has the delay.
    whole = compare_methods(plant.with_delay("u1", 0.01), ["riccati"], **asked)
    assert [r.part for r in whole] == ["u1, u2"]


def test_the_status_follows_the_norm_achieved_and_not_the_claim():
    found = compare_methods(benner_weak(), ["slycot"])["slycot"]
    assert found.design is not None
    bound = found.design.lower_bound or 0.0
    assert bound == pytest.approx(0.806, rel=1e-3)
    assert found.achieved >= bound
    assert (found.status == "optimal") == (found.achieved <= 1.004 * bound)


def test_failures_are_listed_with_their_reason():
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[0.0]], [[1.0]], [[1.0]])
    table = compare_methods(plant, ["riccati", "slycot"])
    assert {r.status for r in table} == {"infeasible"}
    assert np.isnan(table["riccati"].achieved)
    assert "uncontrollable mode +1" in table["riccati"].message
    assert f"riccati: {table['riccati'].message}"[:60] in str(table)
    assert not np.isfinite(table.plot().lines[2].get_xdata()).any()


@pytest.mark.parametrize("methods", [["magic"], "riccati", ["lmi/gurobi"], ["riccati/scipy"]])
def test_unknown_methods_are_refused(methods):
    with pytest.raises(rp.InvalidInputError, match=r"^methods: "):
        compare_methods(scherer_1997(), methods)


# One design for each price on u.


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
