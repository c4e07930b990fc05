"""Frequency responses from files, objects and time records."""

import control
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from scipy.signal import freqz, lfilter

from robustpolish import InvalidInputError, estimate_frequency_response, read_frequency_response
from robustpolish.signals.frequency_response import (
    checked_response,
    holds_frequency_response,
    labelled_response,
    responses_of,
)
from robustpolish.signals.raw import RawTable

LINES = np.array([1.0, 2.0, 4.0, 8.0])
VALUES = np.array([2.0, 3j, -1.0, -0.5j]) * 1e-6


def table(**more):
    return pd.DataFrame(
        {
            "frequency [Hz]": LINES,
            "x/F real [um/N]": 1e6 * VALUES.real,
            "x/F imag [um/N]": 1e6 * VALUES.imag,
            **more,
        }
    )


def check(response, unit="m/N", values=VALUES):
    assert response.dims == ("frequency", "output", "input")
    assert response["units"].item() == unit
    np.testing.assert_allclose(response["frequency"], LINES)
    np.testing.assert_allclose(response.values[:, 0, 0], values, rtol=1e-6)


def test_a_table_in_text(tmp_path):
    path = tmp_path / "frf.csv"
    table(**{"x/F coherence": [1, 0.9, 0.8, 0.7]}).to_csv(path, index=False)
    response = read_frequency_response(path)
    check(response)
    assert response.attrs["source"] == str(path)
    np.testing.assert_allclose(response["coherence"].values.ravel(), [1, 0.9, 0.8, 0.7])


@pytest.mark.parametrize(("unit", "scale"), [("rad/s", 2 * np.pi), ("kHz", 1e-3), ("Hz", 1.0)])
def test_the_unit_of_frequency(unit, scale):
    frame = table().rename(columns={"frequency [Hz]": f"freq [{unit}]"})
    frame[f"freq [{unit}]"] *= scale
    check(read_frequency_response(frame))


def test_decibels_and_degrees():
    frame = pd.DataFrame(
        {
            "f": LINES,
            "|x/F| [dB re 1 m/N]": 20 * np.log10(np.abs(VALUES)),
            "arg(x/F)": np.degrees(np.angle(VALUES)),
        }
    )
    check(read_frequency_response(frame))


def test_what_a_head_does_not_say_is_told():
    size = np.array([60.0, 20.0, -40.0])
    frame = pd.DataFrame({"Frequency": [1.0, 2, 3], "Phase": [0.0, -90, -180], "Gain": size})
    found = read_frequency_response(frame)
    np.testing.assert_allclose(found.values.ravel(), [1e3, -10j, -1e-2], atol=1e-12)
    assert found.attrs["notes"] == [
        "Frequency has no unit: read in Hz", "Gain has no unit: read as dB",
        "Phase has no unit: read in degrees",
    ]  # fmt: skip
    frame["Gain"] = [3.0, 2.0, 1.0]
    notes = read_frequency_response(frame).attrs["notes"]
    assert "Gain has no unit: read as a ratio" in notes


def test_complex_columns_and_names_by_order():
    frame = pd.DataFrame({"frequency": LINES, "node 3/node 1": VALUES * 1e3})
    given = read_frequency_response(frame, outputs=["x"], inputs=["F"], units="mm/N")
    check(given)
    assert (given["output"].item(), given["input"].item()) == ("x", "F")


def test_variance_is_converted_with_its_square():
    response = read_frequency_response(table(**{"x/F variance": [1.0, 1, 1, 4]}))
    np.testing.assert_allclose(response["variance"].values.ravel(), [1e-12, 1e-12, 1e-12, 4e-12])


def test_responses_of_control():
    system = control.ss([[0, 1], [-4, -0.1]], [[0], [1]], [[1, 0]], [[0]], inputs="F", outputs="x")
    data = control.frd(system, 2 * np.pi * LINES)
    response = read_frequency_response(data)
    check(response, "", system(2j * np.pi * LINES))


def test_universal_files(tmp_path):
    pyuff = pytest.importorskip("pyuff")
    path = tmp_path / "frf.uff"
    common = {
        "type": 58, "rsp_node": 3, "rsp_dir": 3, "ref_node": 1, "ref_dir": -3,
        "x": LINES, "abscissa_spacing": 0, "binary": 0,
        "id1": "a", "id2": "b", "id3": "c", "id4": "d", "id5": "e",
        "ref_ent_name": "NONE", "rsp_ent_name": "NONE",
    }  # fmt: skip
    response = common | {
        "func_type": 4, "data": VALUES * 1e3, "ordinate_axis_units_lab": "mm",
        "orddenom_axis_units_lab": "N", "ordinate_spec_data_type": 8, "orddenom_spec_data_type": 13,
    }  # fmt: skip
    coherence = common | {
        "orddenom_spec_data_type": 0,
        "func_type": 6,
        "data": np.array([1.0, 0.9, 0.8, 0.7]),
    }
    pyuff.UFF(str(path)).write_sets([response, coherence], mode="overwrite")
    assert holds_frequency_response(path)
    read = read_frequency_response(path)
    check(read)
    assert (read["output"].item(), read["input"].item()) == ("node_3_z", "node_1_-z")
    np.testing.assert_allclose(read["coherence"].values.ravel(), [1, 0.9, 0.8, 0.7], rtol=1e-6)


def test_arrays_are_renamed_and_kept():
    array = labelled_response(LINES, VALUES[:, None, None], ["a"], ["b"], "m/N")
    check(read_frequency_response(array, outputs={"a": "x"}, inputs="F"))


def test_pairs_that_were_not_measured_are_nan():
    frame = table(**{"y/G real": 1.0, "y/G imag": 0.0})
    response = read_frequency_response(frame)
    assert response.shape == (4, 2, 2)
    assert np.isnan(response.sel(output="y", input="F")).all()


def test_what_is_a_response_is_known(tmp_path):
    over_time, over_frequency = tmp_path / "a.csv", tmp_path / "b.csv"
    over_time.write_text("time [s],x [m]\n0,1\n1,2\n")
    over_frequency.write_text("# made by hand\nFreq [Hz];x/F real;x/F imag\n1;2;3\n")
    assert not holds_frequency_response(over_time)
    assert holds_frequency_response(over_frequency)
    over_time.write_text("F [N],x [m]\n0,1\n1,2\n")
    assert not holds_frequency_response(over_time)
    over_time.write_text("frequency [Hz],time [s],x [m]\n0,1,2\n1,2,3\n")
    assert not holds_frequency_response(over_time)  # a channel of a record
    over_time.write_text("Frequency,1000\nLogger,A\nZeit (s),x (mm)\n0,1\n0.001,2\n")
    assert not holds_frequency_response(over_time)  # the rate of a data logger
    over_frequency.write_text("Analyser 3\n\nf/Hz\tx/F real\tx/F imag\n1,5\t2\t3\n2\t3\t4\n")
    assert holds_frequency_response(over_frequency)
    over_time.write_text("no table at all\n")
    assert not holds_frequency_response(over_time)
    assert not holds_frequency_response(xr.Dataset(coords={"time": [0.0, 1.0]}))


@pytest.mark.parametrize(
    ("frame", "message"),
    [
        (table().drop(columns="x/F imag [um/N]"), "magnitude and phase"),
        (table(**{"x/F loudness": 1.0}), "a head such as"),
        (table().drop(columns="frequency [Hz]"), "a column 'frequency"),
        (table().iloc[[0, 1, 1, 2]], "each frequency once"),
        (table().iloc[:2], "three or more"),
        (table().assign(**{"x/F real [um/N]": 0.0, "x/F imag [um/N]": 0.0}), "zero at every"),
    ],
)
def test_what_is_refused(frame, message):
    with pytest.raises(InvalidInputError, match=message):
        read_frequency_response(frame)


def test_unknown_names_are_refused():
    with pytest.raises(InvalidInputError, match="one of x"):
        read_frequency_response(table(), outputs={"z": "x"})
    with pytest.raises(InvalidInputError, match="1 names"):
        read_frequency_response(table(), inputs=["F", "G"])
    with pytest.raises(InvalidInputError, match="a pair of the file"):
        read_frequency_response(table(), units={"z/F": "m"})
    with pytest.raises(InvalidInputError, match="a file or object"):
        read_frequency_response(3)


def only_response(*heads, columns=((1.0, 2.0),) * 3, **how):
    table = RawTable()
    for head, values in zip(heads, columns, strict=True):
        table.add(head, np.array(values, dtype=float), **how)
    (found,) = responses_of(table)
    return found


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("x/F real", "x/F imag"),
        ("Re(x/F)", "Im(x/F)"),
        ("x/F_re", "x/F_im"),
        ("real x/F", "imaginary x/F"),
    ],
)
def test_parts_are_known_before_and_behind_the_pair(first, second):
    found = only_response("f [Hz]", first, second, columns=([1, 2], [3, 4], [5, 6]))
    assert (found.output, found.input, found.kind) == ("x", "F", "response")
    np.testing.assert_allclose(found.values, [3 + 5j, 4 + 6j])


def test_a_single_pair_needs_no_name():
    found = only_response("omega", "magnitude [m/N]", "phase [rad]")
    assert (found.output, found.input, found.unit) == ("output", "input", "m/N")
    assert found.frequency_unit == "rad/s"
    np.testing.assert_allclose(found.values, [1, 2] * np.exp(1j * np.array([1.0, 2.0])))


def test_an_imaginary_part_in_another_unit_is_converted():
    found = only_response("f", "x/F real [um/N]", "x/F imag [mm/N]")
    np.testing.assert_allclose(found.values, [1 + 1000j, 2 + 2000j])


def test_a_stroke_stands_in_a_pair_unless_it_cannot():
    found = only_response("f/kHz", "magnitude x/V", "phase x/V", fraction=True)
    assert (found.output, found.input, found.unit) == ("x", "V", "")
    assert found.frequency_unit == "kHz"
    found = only_response("f/Hz", "magnitude/(um/N)", "phase/rad", fraction=True)
    assert (found.output, found.input, found.unit) == ("output", "input", "um/N")
    np.testing.assert_allclose(found.values, [1, 2] * np.exp(1j * np.array([1.0, 2.0])))


DT = 1e-2
B, A = [0.0, 0.5, 0.3], [1.0, -0.6, 0.3]  # well damped: nothing leaks


def filtered(signal):
    return lfilter(B, A, signal)


def record(seed=0, noise=0.3, input_noise=0.0, samples=40000):
    rng = np.random.default_rng(seed)
    force = rng.standard_normal(samples)
    x = filtered(force) + noise * rng.standard_normal(samples)
    force = force + input_noise * rng.standard_normal(samples)
    return dataset(F=(force, "N"), x=(x, "m"))


def dataset(**columns):
    size = len(next(iter(columns.values()))[0])
    return xr.Dataset(
        {name: ("time", values, {"units": unit}) for name, (values, unit) in columns.items()},
        {"time": np.arange(size) * DT},
    )


def truth(response):
    return freqz(B, A, 2 * np.pi * response["frequency"].values * DT)[1]


def test_the_stated_variance_is_that_of_the_estimate():
    inside = []
    for seed in range(6):
        response = estimate_frequency_response(record(seed), "F", "x", segment=2.0)
        error = np.abs(response.values[:, 0, 0] - truth(response)) ** 2
        inside.append(np.mean(error / response["variance"].values[:, 0, 0]))
    assert 0.8 < np.mean(inside) < 1.25
    assert response["units"].item() == "m/N"


@pytest.mark.parametrize("overlap", [0.0, 0.5, 0.75])
def test_segments_that_overlap_count_as_fewer(overlap):
    response = estimate_frequency_response(record(), "F", "x", segment=2.0, overlap=overlap)
    assert 190 < response.attrs["averages"] < 430  # Hann, 75 %: 2.1 times as many


def test_noise_on_the_input_biases_h1_only():
    data = record(noise=0.0, input_noise=0.5, samples=200000)
    sizes = {}
    for method in ("H1", "H2", "Hv"):
        response = estimate_frequency_response(data, ["F"], ["x"], method=method, segment=2.0)
        sizes[method] = np.mean(np.abs(response.values[:, 0, 0]) / np.abs(truth(response)))
    assert sizes["H1"] == pytest.approx(0.8, abs=0.01)  # 1 / (1 + 0.5^2)
    assert sizes["H2"] == pytest.approx(1.0, abs=0.01)
    assert sizes["Hv"] == pytest.approx(np.sqrt(0.8), abs=0.01)


def test_two_inputs_are_taken_apart():
    rng = np.random.default_rng(0)
    first = rng.standard_normal(100000)
    second = rng.standard_normal(100000) + 0.7 * first
    noise = 0.1 * rng.standard_normal(100000)
    data = dataset(F=(first, "N"), G=(second, "N"), x=(filtered(first) - 2 * second + noise, "m"))
    response = estimate_frequency_response(data, ["F", "G"], "x", segment=2.0)
    error = response.values[:, 0, 0] - truth(response), response.values[:, 0, 1] + 2
    spread = np.sqrt(response["variance"].values[:, 0])
    assert np.sqrt(np.mean(np.abs(error[0]) ** 2)) < 1.5 * spread[:, 0].mean()
    assert np.sqrt(np.mean(np.abs(error[1]) ** 2)) < 1.5 * spread[:, 1].mean()
    with pytest.raises(InvalidInputError, match="one input, or H1"):
        estimate_frequency_response(data, ["F", "G"], "x", method="H2")


def test_whole_periods_leak_nothing():
    period = np.random.default_rng(0).standard_normal(400)
    data = dataset(F=(np.tile(period, 10), "N"), x=(filtered(np.tile(period, 20))[4000:], "m"))
    response = estimate_frequency_response(
        data, "F", "x", segment=4.0, window="boxcar", overlap=0.0
    )
    np.testing.assert_allclose(response.values[:, 0, 0], truth(response), atol=1e-9)


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"inputs": "G"}, "no column 'G'"),
        ({"segment": 300.0}, "independent segments"),
        ({"segment": 1e3}, "samples of"),
        ({"overlap": 0.95}, "at most 0.9"),
        ({"method": "H3"}, "one of 'H1'"),
    ],
)
def test_what_is_refused_estimate(asked, message):
    with pytest.raises(InvalidInputError, match=message):
        estimate_frequency_response(record(), **{"inputs": "F", "outputs": "x", **asked})


LINES_RESPONSE = [1.0, 2.0, 3.0]


def test_one_pair_gets_its_dimensions_back():
    whole = labelled_response(
        LINES_RESPONSE, np.ones((3, 2, 1)), ["x", "y"], ["F"], [["m/N"], ["rad/N"]],
        beside={"variance": np.full((3, 2, 1), 0.1)}, attributes={"averages": 5.0},
    )  # fmt: skip
    one = checked_response(whole.sel(output="y", input="F"))
    assert one.shape == (3, 1, 1)
    assert one["units"].item() == "rad/N"
    assert one["variance"].shape == (3, 1, 1)
    assert one.attrs["averages"] == 5.0


def test_frequencies_are_sorted_with_what_lies_beside():
    curve = np.array([3.0, 1, 2])
    array = labelled_response(
        curve, curve[:, None, None], ["x"], ["F"], beside={"coherence": curve[:, None, None] / 3}
    )
    sorted_ = checked_response(array)
    np.testing.assert_allclose(sorted_.values.ravel(), LINES_RESPONSE)
    np.testing.assert_allclose(sorted_["coherence"].values.ravel(), np.array(LINES_RESPONSE) / 3)


@pytest.mark.parametrize(
    ("array", "message"),
    [
        (xr.DataArray(np.ones(3), {"frequency": LINES_RESPONSE}, "frequency"), "without 'output'"),
        (labelled_response([-1, 0, 1], np.ones((3, 1, 1)), ["x"], ["F"]), "Hz from 0"),
        (labelled_response(LINES_RESPONSE, np.full((3, 1, 1), np.inf), ["x"], ["F"]), "infinite"),
        (
            labelled_response(LINES_RESPONSE, np.ones((3, 2, 1)), ["x", "x"], ["F"]),
            "each name once",
        ),
    ],
)
def test_what_is_refused_response(array, message):
    with pytest.raises(InvalidInputError, match=message):
        checked_response(array)
