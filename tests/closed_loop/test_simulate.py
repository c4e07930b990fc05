"""Loops under a disturbance, and the comparison of controllers."""

import dataclasses
from concurrent.futures import ThreadPoolExecutor

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.errors import InvalidInputError

# Loops under a load: statics by hand, effort, and complaints.


def test_statics_of_the_open_loop(load):
    """A constant load ends, on average, at force over stiffness."""
    p = rp.polishing.AirBearingParameters()
    response = rp.simulate(rp.air_bearing(p), load)
    swing = response["y"].sel(time=slice(0, 8 / 194.0691))
    assert float(swing.mean()) == pytest.approx(-10 * (1 / p.k_t + 1 / p.k_x), rel=0.02)
    assert float(np.abs(response["x"]).max()) == 0.0
    assert response["y"].attrs["units"] == "m"


def test_effort_is_the_gain_times_the_state(stiff, load):
    response = rp.simulate(stiff, load)
    assert response["u_y"].attrs["units"] == "N"
    speed = np.gradient(response["y"].to_numpy(), response["time"].to_numpy())
    expected = -1e7 * response["y"] - 200.0 * speed
    # The largest effort is quasi-static, so finite differences are good enough there.
    late = slice(0.1, None)
    np.testing.assert_allclose(
        response["u_y"].sel(time=late), expected.sel(time=late), rtol=2e-2, atol=0.1
    )


def test_a_system_is_simulated_as_it_is(stiff, load):
    direct = rp.simulate(stiff.closed_loop, load)
    through_design = rp.simulate(stiff, load)
    np.testing.assert_allclose(direct["y"], through_design["y"], rtol=1e-12, atol=1e-18)


def test_disturbances_that_are_not_given_are_zero(load):
    plant = rp.air_bearing()
    zero = load.assign(F_y=0 * load["F_y"])
    left_out = rp.simulate(plant, load.drop_vars("F_y"))
    xr.testing.assert_allclose(left_out, rp.simulate(plant, zero))


def test_bad_disturbances_are_named(load):
    plant = rp.air_bearing()
    with pytest.raises(InvalidInputError, match=r"'f_y'.*one named 'F_y'"):
        rp.simulate(plant, load.rename(F_y="f_y"))
    with pytest.raises(InvalidInputError, match="got variables none, expected one of 'F_x', 'F_y'"):
        rp.simulate(plant, xr.Dataset(coords={"time": load["time"]}))
    with pytest.raises(InvalidInputError, match="unit kN"):
        rp.simulate(plant, load.assign(F_y=load["F_y"].assign_attrs(units="kN")))
    with pytest.raises(InvalidInputError, match="no coordinate 'time'"):
        rp.simulate(plant, load.drop_vars("time"))
    with pytest.raises(InvalidInputError, match="uniform"):
        rp.simulate(plant, load.isel(time=[0, 1, 5]))
    with pytest.raises(InvalidInputError, match="disturbance: got dict"):
        rp.simulate(plant, {"F_x": 1})
    with pytest.raises(InvalidInputError, match="design: got float"):
        rp.simulate(3.0, load)
    with pytest.raises(InvalidInputError, match="finite"):
        rp.simulate(plant, load.assign(F_y=load["F_y"] * np.nan))


# The comparison table: its numbers, its words, its picture.


@pytest.fixture
def comparison(soft, stiff, load):
    return rp.compare_controllers({"soft": soft, "stiff": stiff}, load, signals=("x", "y", "z"))


def test_rows_hold_the_largest_deviations(comparison, stiff, load):
    expected = float(np.abs(rp.simulate(stiff, load)["y"]).max())
    table = comparison.table
    assert float(table["deviation"].sel(row="stiff", signal="y")) == expected
    reference = float(table["deviation"].sel(row="without control", signal="y"))
    assert float(table["improvement"].sel(row="stiff", signal="y")) == pytest.approx(
        100 * (1 - expected / reference)
    )
    assert list(table["row"].to_numpy()) == ["without control", "soft", "stiff"]


def test_a_signal_at_rest_has_no_improvement(comparison):
    assert np.isnan(comparison.table["improvement"].sel(signal="x")).all()


def test_effort_has_its_unit(comparison, stiff, load):
    response = rp.simulate(stiff, load)
    largest = max(float(np.abs(response[name]).max()) for name in stiff.plant.control_names)
    assert float(comparison.table["effort"].sel(row="stiff")) == largest
    assert comparison.table["effort"].attrs["units"] == "N"
    assert np.isnan(comparison.table["effort"].sel(row="without control"))


def test_words_say_that_the_load_is_the_same(comparison):
    text = str(comparison)
    assert "every row is driven by the same disturbance" in text
    assert len({len(line) for line in text.splitlines()[:-1]}) == 1
    assert "<table>" in comparison._repr_html_()


def test_what_is_shown_has_the_prefix_of_the_figure(comparison):
    (_, *names), body = comparison.shown_rows()
    assert names[:3] == ["max |x| [µm]", "max |y| [µm]", "max |z| [µm]"]
    np.testing.assert_allclose(body[0][2], 1e6 * comparison.rows()[1][0][2], rtol=1e-12)
    assert "max |y| [µm]" in str(comparison)


def test_signals_of_several_units_keep_them(comparison):
    changed = {
        row: response.assign(x=response["x"].assign_attrs(units="m/s^2"))
        for row, response in comparison.responses.items()
    }
    header, _ = dataclasses.replace(comparison, responses=changed).shown_rows()
    assert header[1:3] == ("max |x| [m/s^2]", "max |y| [µm]")


def test_plot_draws_every_row(comparison):
    axes = comparison.plot(signal="y")
    assert [text.get_text() for text in axes.get_legend().get_texts()] == [
        "without control",
        "soft",
        "stiff",
    ]
    assert axes.get_ylabel() == "y [µm]"
    assert axes.yaxis.get_major_formatter()(2e-5) == "20"
    plt.close(axes.figure)


def test_threads_give_the_bits_of_one_by_one(comparison, soft, stiff, load):
    with ThreadPoolExecutor(2) as threads:
        again = rp.compare_controllers(
            {"soft": soft, "stiff": stiff}, load, signals=("x", "y", "z"), executor=threads
        )
        assert again.table.identical(comparison.table)
        for row, response in comparison.responses.items():
            assert again.responses[row].identical(response)
        with pytest.raises(InvalidInputError, match="time"):
            rp.compare_controllers({"soft": soft}, load.drop_vars("time"), executor=threads)


@pytest.mark.long
def test_processes_give_the_bits_of_one_by_one(comparison, soft, stiff, load):
    again = rp.compare_controllers(
        {"soft": soft, "stiff": stiff}, load, signals=("x", "y", "z"), executor=None
    )
    for row, response in comparison.responses.items():
        assert again.responses[row].identical(response)


def test_bad_arguments_are_named(comparison, soft, load):
    with pytest.raises(InvalidInputError, match="controllers: got"):
        rp.compare_controllers({}, load)
    with pytest.raises(InvalidInputError, match="got float"):
        rp.compare_controllers({"a": 1.0}, load)
    with pytest.raises(InvalidInputError, match="signals: got 'q'"):
        rp.compare_controllers({"a": soft}, load, signals=["q"])
    with pytest.raises(InvalidInputError, match="signal: got 'q'"):
        comparison.plot(signal="q")
