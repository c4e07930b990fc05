"""Frequency responses from files and objects."""

import control
import numpy as np
import pandas as pd
import pytest
import xarray as xr

from robustpolish import InvalidInputError, read_frequency_response
from robustpolish.signals.frequency_response import holds_frequency_response, labelled_response

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
