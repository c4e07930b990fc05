"""How the subcommands read a measurement."""

from pathlib import Path

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.app.cli.options import Reading, load_data, load_records, replaceable
from robustpolish.errors import InvalidInputError

GROUND = ("x", "ground")
MODEL = rp.MechanicalModel(
    [rp.Dof("x", 1.0)], inputs=[rp.Input("F", GROUND)], outputs=[rp.Output("x", GROUND)]
)


@pytest.fixture
def path(tmp_path):
    time = np.arange(200) / 100
    columns = np.column_stack([np.sin(9 * time), np.cos(7 * time), np.full(200, 20.0)])
    np.savetxt(tmp_path / "a.csv", columns, delimiter=",", header="F,x,T", comments="")
    return str(tmp_path / "a.csv")


def test_only_what_the_model_needs_is_read_in_the_units_given(path):
    data = load_data(path, MODEL, Reading(sampling_rate=100.0, units=("F=kN", "x=mm")))
    assert set(data.data_vars) == {"F", "x"}  # the constant temperature is no signal
    assert float(data["x"][0]) == pytest.approx(1e-3)
    assert float(abs(data["F"]).max()) == pytest.approx(1e3, rel=1e-2)
    assert data["time"].values[1] == pytest.approx(0.01)


def test_several_files_are_read_alike_and_go_by_their_names(path, tmp_path):
    other = tmp_path / "b.csv"
    other.write_text(Path(path).read_text())
    reading = Reading(sampling_rate=100.0, between=(0.5, 1.0), units=("F=kN", "x=mm"))
    found = load_records((path, str(other)), MODEL, reading)
    assert list(found) == ["a", "b"]
    for data in found.values():
        assert data.sizes["time"] == 51
        assert float(abs(data["F"]).max()) > 100
    (tmp_path / "again").mkdir()
    same = tmp_path / "again" / "a.csv"
    same.write_text(Path(path).read_text())
    assert list(load_records((path, str(same)), MODEL, reading)) == [path, str(same)]
    with pytest.raises(InvalidInputError, match=r"a.csv twice, expected each file once"):
        load_records((path, path), MODEL, reading)


def test_a_unit_without_its_column_is_refused(path):
    with pytest.raises(InvalidInputError, match=r"--unit: got 'mm', expected COLUMN=UNIT"):
        load_data(path, MODEL, Reading(sampling_rate=100.0, units=("mm",)))


def test_time_names_and_parts_can_be_said(path):
    model = rp.MechanicalModel(
        [rp.Dof("x", 1.0)], inputs=[rp.Input("F", GROUND)], outputs=[rp.Output("y", GROUND)]
    )
    names, *rows = Path(path).read_text().replace("F,x,T", "a=b,clock,y").splitlines()
    rows = [f"{i / 100},{row}" for i, row in enumerate(rows)]
    Path(path).write_text("\n".join([f"runs,{names}", *rows]) + "\n")
    reading = Reading(time="runs", renames=("a=b=F", "clock=y", "y=T"), between=(0.5, 1.0))
    data = load_data(path, model, reading)
    assert set(data.data_vars) == {"F", "y"}
    assert (float(data["time"][0]), float(data["time"][-1])) == (0.5, 1.0)
    with pytest.raises(InvalidInputError, match=r"--rename: got 'F', expected OLD=NEW"):
        load_data(path, model, Reading(renames=("F",)))


def test_only_json_of_an_earlier_run_is_replaced(tmp_path):
    out, data = str(tmp_path / "out.json"), str(tmp_path / "data.json")
    assert replaceable(out, data)
    assert not replaceable(data, data)
    assert not replaceable(str(tmp_path / "sub" / ".." / "data.json"), data)
    assert not replaceable(str(tmp_path / "out.csv"), data)


def test_the_limit_of_size_can_be_said(path):
    with pytest.raises(InvalidInputError, match="max_bytes"):
        load_data(path, MODEL, Reading(sampling_rate=100.0, max_bytes=10.0))
    reading = Reading(sampling_rate=100.0, units=("F=kN", "x=mm"), max_bytes=1e6)
    assert set(load_data(path, MODEL, reading)) == {"F", "x"}
