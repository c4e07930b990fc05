"""Commands on measurements: compare, refit, diagnose and tell-apart; JSON and exit codes."""

import json
import shlex
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import robustpolish as rp
from robustpolish.app.cli.options import Reading, load_data, load_records, replaceable
from robustpolish.errors import InvalidInputError
from robustpolish.identification.findings import IndistinguishablePair
from robustpolish.machines.effects.effect import Effect
from robustpolish.machines.mechanical.model import MechanicalModel
from robustpolish.machines.simulation import simulate_model as simulate
from tests import made_up
from tests.app.command_line import run
from tests.hidden_effects.cases import Case, model_of, one, records
from tests.identification.oscillators import PLACE, oscillator, record
from tests.machine_files import machine

MODEL = machine("oscillator")


def csv(head, *columns):
    rows = zip(*(np.asarray(column).tolist() for column in columns), strict=True)
    return "\n".join([head, *(",".join(map(repr, row)) for row in rows)]) + "\n"


def table(samples=1000, noise=0.01):
    random = np.random.default_rng(0)
    time = np.arange(samples) / 1000
    data = xr.Dataset({"F": ("time", random.standard_normal(samples))}, {"time": time})
    x = simulate(MechanicalModel.from_toml(MODEL), data).outputs[:, 0]
    x = x + noise * np.std(x) * random.standard_normal(samples)
    return csv("time [ms],F [kN],x [um]", time * 1e3, data["F"].values / 1e3, x * 1e6)


def responses(pair="x/F"):
    lines = np.arange(5.0, 60.0, 0.5)
    curve = MechanicalModel.from_toml(MODEL).frequency_response(lines).values[:, 0, 0] * 1e6
    unit = " [um/N]" if pair == "x/F" else ""
    head = f"frequency [Hz],{pair} real{unit},{pair} imag{unit}"
    return csv(head, lines, curve.real, curve.imag)


CSV = table()


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "data.csv").write_text(CSV)
    (tmp_path / "model.toml").write_text(MODEL)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def compare(*arguments, data="data.csv", model="model.toml", code=0):
    return run("compare", data, *map(str, arguments), "--model", model, code=code)


def content(path="out.json"):
    return json.loads(Path(path).read_text())


def contents(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir()}


@pytest.mark.usefixtures("folder")
def test_the_json_that_programs_rely_on():
    assert "fit 98.98 %" in compare("--json", "out.json").output
    found = content()["outputs"]["x"]
    assert found["unit"] == "m"
    assert found["nrmse"] == pytest.approx(0.01, rel=0.1)
    assert found["fit_percent"] == pytest.approx(100 * (1 - found["nrmse"]))
    assert 0 < found["rmse"] < 1e-6
    compare("--json", "out.json")  # made again
    Path("model.toml").write_text(MODEL.replace("2e4", "9e4"))
    compare()  # a bad fit is no error


def test_windows_horizons_residuals_and_pictures(folder):
    compare("--window", 0.1, "--plot", "out.png")
    assert (folder / "out.png").stat().st_size > 10_000
    assert "prediction of 0.01 s" in compare("--horizon", 0.01).output
    assert "Where the error is" in compare("--residuals").output


def test_units_rates_names_and_parts_can_be_given(folder):
    (folder / "data.csv").write_text(CSV.replace("time [ms],F [kN],x [um]", "n,F,x"))
    given = ("--unit", "F=kN", "--unit", "x=um", "--sampling-rate", 1000)
    assert "fit 98.98 %" in compare(*given).output
    text = CSV.replace("time [ms],F [kN],x [um]", "clock [ms],force/kN,disp (um)")
    (folder / "data.csv").write_text(text)
    names = ("--time", "clock", "--rename", "force=F", "--rename", "disp=x")
    assert "fit 98.9" in compare(*names, "--between", 0.1, 0.9).output


def test_several_files_are_compared_one_by_one(folder):
    (folder / "again.csv").write_text(table(400, noise=0.03))
    result = compare("again.csv", "--json", "out.json", "--residuals")
    assert "Record by record" in result.output
    found = content()["records"]
    assert list(found) == ["data", "again"]
    assert found["again"]["nrmse"]["x"] == pytest.approx(0.03, rel=0.15)
    cut = compare("again.csv", "--between", 0.1, 0.3, "--json")
    assert set(json.loads(cut.output)["records"]) == {"data", "again"}
    compare("data.csv", code=2)  # twice the same


def test_frequency_responses_are_recognised(folder):
    (folder / "frf.csv").write_text(responses())
    result = compare("--json", "out.json", "--plot", "out.png", data="frf.csv")
    assert "Comparison (frequency responses), error 0.00 %" in result.output
    found = content()
    assert found["pairs"]["x/F"]["relative"] < 1e-6
    assert found["modes"][0]["frequency"] == pytest.approx(np.sqrt(4e4) / 2 / np.pi, rel=1e-4)
    assert (folder / "out.png").stat().st_size > 10_000
    fitted = json.loads(run("refit", "frf.csv", "--model", "model.toml", "--json").stdout)
    numbers = fitted["parameters"]
    ratio = numbers["spring[0].stiffness"]["value"] / numbers["dof.x.mass"]["value"]
    assert ratio == pytest.approx(4e4, rel=1e-3)
    run("refit", "frf.csv", "data.csv", "--model", "model.toml", code=2)
    assert "one file with responses" in compare("data.csv", data="frf.csv", code=2).output
    (folder / "frf.csv").write_text(responses("tip/hammer"))
    names = ("--rename", "tip=x", "--rename", "hammer=F", "--unit", "x/F=um/N")
    assert "error 0.00 %" in compare(*names, data="frf.csv").output


def test_what_frequency_responses_do_not_have_is_refused(folder):
    (folder / "frf.csv").write_text("f,x/F real,x/F imag\n1,2,3\n2,3,4\n3,4,5\n")
    for option in (
        ("--window", 1.0), ("--horizon", 0.0), ("--residuals",), ("--table", "rig"),
        ("--time", "t"), ("--sampling-rate", 1000), ("--between", 0.0, 1.0),
    ):  # fmt: skip
        told = compare(*option, data="frf.csv", code=2).output
        assert f"{option[0]}: got" in told
        assert "a record over time" in told
    (folder / "frf.csv").write_text("f,x/x real,x/x imag\n1,2,3\n2,3,4\n3,4,5\n")
    for names in (("--rename", "q=x"), ("--rename", "x=F")):  # there is none, or there are two
        assert "--rename: got" in compare(*names, data="frf.csv", code=2).output
    assert "OUTPUT/INPUT=UNIT" in compare("--unit", "m", data="frf.csv", code=2).output


BAD = {
    "no data": ({"data": "none.csv"}, (), "No such file"),
    "no model": ({"model": "none.toml"}, (), "No such file"),
    "window": ({}, ("--window", 100), "window"),
    "both": ({}, ("--window", 0.1, "--horizon", 0.1), "either"),
    "unit": ({}, ("--unit", "x"), "COLUMN=UNIT"),
    "rename": ({}, ("--rename", "x"), "OLD=NEW"),
    "rename of nothing": ({}, ("--rename", "q=x"), "no channel 'q'"),
    "time": ({}, ("--time", "q"), "no channel 'q'"),
    "part": ({}, ("--between", 5, 6), "between"),
    "unit of nothing": ({}, ("--unit", "y=mm"), "'y'"),
    "kind": ({}, ("--unit", "x=kN"), "a column in N"),
    "picture": ({}, ("--plot", "out.doc"), "out"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_ends_with_code_2_and_writes_nothing(case, folder):
    files, arguments, message = BAD[case]
    before = contents(folder)
    assert message in compare(*arguments, "--json", "out.json", **files, code=2).output
    assert contents(folder) == before


def test_inputs_are_never_overwritten(folder):
    for target in ("data.csv", "model.toml"):
        compare("--json", target, code=2)
    assert (folder / "data.csv").read_text() == CSV


@pytest.mark.parametrize("data", [("data.csv",), ("data.csv", "again.csv")])
def test_the_numbers_come_out_and_the_model_is_saved(folder, data):
    (folder / "again.csv").write_text(table(600, noise=0.02))
    (folder / "model.toml").write_text(MODEL.replace("2e4", "2.3e4"))
    saving = ("refit", *data, "--model", "model.toml", "--save", "fitted.toml")
    result = run(*saving, "--json", "out.json")
    assert "spring[0].stiffness" in result.output
    told = content()
    found = told["parameters"]
    ratio = found["spring[0].stiffness"]["value"] / found["dof.x.mass"]["value"]
    assert ratio == pytest.approx(4e4, rel=1e-3)
    assert found["spring[0].stiffness"]["unit"] == "N/m"
    assert len(told["records"]) == len(data)
    for each in told["records"].values():
        assert 0.009 < each["nrmse"]["x"] < 0.03
        assert each["reproducible"]
    assert ("Record by record" in result.output) == (len(data) > 1)
    assert 0.009 < told["nrmse"]["x"] < (0.011 if len(data) == 1 else 0.02)
    assert "fit 98.9" in compare(model="fitted.toml").output
    run(*saving, code=2)  # it exists
    run(*saving, "--force")
    (folder / "data.csv").write_text("time [s],F [N]\n0,1\n0.1,2\n")
    before = contents(folder)
    refused = run("refit", *data, "--model", "model.toml", "--save", "new.toml", code=2)
    assert "x" in refused.output
    assert contents(folder) == before


CASE = Case(
    "quadratic damping", one(0.005), [("quadratic_damping", ("x", "ground"), [4.0])], drive=20.0,
    samples=3000, seed=11,
)  # fmt: skip
(SEEN, _), (UNSEEN, NOISE) = records(CASE)
OSCILLATOR = model_of(CASE).to_toml()


def written(data):
    x = data["x"].values * 1e3
    return csv("time [s],F_x [N],x [mm]", data["time"].values, data["F_x"].values, x)


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("diagnosed")
    for name, text in {
        "seen.csv": written(SEEN), "unseen.csv": written(UNSEEN), "model.toml": OSCILLATOR,
    }.items():  # fmt: skip
        (folder / name).write_text(text)
    places = {"--json": "out.json", "--save": "refined.toml", "--report": "report.html"}
    given = [part for option, name in places.items() for part in (option, str(folder / name))]
    result = run(
        "diagnose", str(folder / "seen.csv"), "--model", str(folder / "model.toml"), *given
    )
    return folder, content(folder / "out.json"), result.output


def test_the_json_that_programs_rely_on_diagnose(diagnosed):
    folder, told, output = diagnosed
    assert told["verdict"] == "missing_effect"
    (effect,) = told["effects"]
    assert (effect["kind"], effect["at"]) == ("quadratic_damping", ["x", "ground"])
    found = effect["parameters"]["coefficient"]
    assert found["value"] == pytest.approx(4.0, rel=0.05)
    assert 0 < found["stderr"] < 0.2
    assert found["unit"].startswith("N")
    assert {"kind", "at", "nrmse_held_out"} <= set(told["candidates"][0])
    assert all({"kind", "at"} == set(e) for pair in told["indistinguishable"] for e in pair)
    steps = [(entry["step"], entry["nrmse"]["x"]) for entry in told["ledger"]]
    assert [step for step, _ in steps] == ["base", "refit", "quadratic_damping at x, ground"]
    assert steps[0][1] > steps[1][1] > steps[2][1]
    assert told["noise_floor"]["x"] == pytest.approx(10 ** (-30 / 20), rel=0.1)
    assert "check" in output.lower()
    assert "screening for effect 1" in output
    # The saved model extrapolates.
    again = ("compare", str(folder / "unseen.csv"), "--model", str(folder / "refined.toml"))
    found = json.loads(run(*again, "--json").output)["outputs"]["x"]
    assert found["rmse"] < 1.2 * NOISE["x"]


def test_a_diagnosis_proposes_steps_that_are_taken_by_hand(diagnosed, monkeypatch):
    folder, _, output = diagnosed
    monkeypatch.chdir(folder)
    (line,) = (line for line in output.splitlines() if "robustpolish try" in line)
    assert ": worth its numbers" in run(*shlex.split(line)[1:]).output
    (effect,) = MechanicalModel.from_toml(folder / "step_1.toml").effects
    assert effect.values["coefficient"] == pytest.approx(4.0, rel=0.05)


def test_the_report_says_where_which_how_much_and_what_to_check(diagnosed):
    page = (diagnosed[0] / "report.html").read_text()
    titles = (
        "The model lacked: ", "Where the model failed", "Which effects were added",
        "How much of the error is gone", "What to check on the machine",
    )  # fmt: skip
    places = [page.index(part) for part in titles]
    assert places == sorted(places)


def test_several_files_make_one_diagnosis(folder):
    for name, part in (("first", slice(0, 1200)), ("second", slice(1200, 2400))):
        (folder / f"{name}.csv").write_text(written(SEEN.isel(time=part)))
    (folder / "model.toml").write_text(OSCILLATOR)
    files = ("first.csv", "second.csv", "--model", "model.toml")
    told = json.loads(run("diagnose", *files, "--json", "--report", "report.html").stdout)
    assert told["effects"][0]["kind"] == "quadratic_damping"
    assert any(reason.startswith("Held out to judge: ") for reason in told["reasons"])
    assert "Held out to judge: " in (folder / "report.html").read_text()


BAD_DIAGNOSE = {
    "short": (written(SEEN.isel(time=slice(0, 20))), OSCILLATOR, "samples"),
    "nan": (written(SEEN).replace("\n0.01,", "\nnan,", 1), OSCILLATOR, "Error"),
    "text": (written(SEEN).replace("\n0.01,", "\nsoon,", 1), OSCILLATOR, "soon"),
    "constant": (written(SEEN.assign(x=0 * SEEN["x"])), OSCILLATOR, "x"),
    "empty": ("", OSCILLATOR, "empty"),
    "negative mass": (written(SEEN), OSCILLATOR.replace("mass = 1.0", "mass = -1.0"), "mass"),
    "unknown key": (written(SEEN), OSCILLATOR + "\n[extra]\na = 1\n", "extra"),
    "unit": (written(SEEN).replace("[mm]", "[N]"), OSCILLATOR, "N"),
}


@pytest.mark.parametrize("case", BAD_DIAGNOSE)
def test_bad_input_ends_with_code_2_and_writes_nothing_diagnose(case, folder):
    seen, model, message = BAD_DIAGNOSE[case]
    (folder / "seen.csv").write_text(seen)
    (folder / "model.toml").write_text(model)
    before, places = contents(folder), ("--json", "out.json", "--save", "refined.toml")
    told = run("diagnose", "seen.csv", "--model", "model.toml", *places, code=2).output
    assert message in told
    assert contents(folder) == before


CUBIC = oscillator().with_effect("cubic_stiffness", PLACE, {"stiffness": 2e4})


@pytest.fixture
def two_models(folder):
    data = record(1500, noise=0.01)
    text = csv("time [s],F [N],x [m]", *(data[name].values for name in ("time", "F", "x")))
    (folder / "data.csv").write_text(text)
    CUBIC.to_toml(folder / "cubic.toml")
    oscillator().to_toml(folder / "plain.toml")
    return folder


def test_two_models_are_told_apart(two_models):
    shown = run("tell-apart", "data.csv", "cubic.toml", "plain.toml", "--no-fit", "--json",
                "out.json", "--plot", "told.png", "--noise", "x=1e-4")  # fmt: skip
    assert "To tell cubic_stiffness at x, ground from " in shown.stdout
    assert "\n  make " in shown.stdout
    assert "... simulating 20 experiments" in shown.stderr
    told = content()
    assert told["told_apart"] is True
    assert told["noise"] == {"x": 1e-4}
    ratios = [e["left_over_noise"] for e in told["experiments"]]
    assert ratios == sorted(ratios, reverse=True)
    best = told["experiments"][0]
    assert best["left"]["x"] / 1e-4 == pytest.approx(best["left_over_noise"])
    assert (two_models / "told.png").stat().st_size > 10_000


def test_a_diagnosis_brings_its_pairs(two_models):
    drag = Effect("quadratic_damping", PLACE, {"coefficient": 0.5})
    pair = IndistinguishablePair(CUBIC.effects[0], drag, "Repeat.")
    found = replace(made_up.diagnosis(), model=CUBIC, indistinguishable=(pair,))
    found.save(two_models / "found.json")
    shown = run("tell-apart", "data.csv", "found.json", "--no-fit", "--limit", "F=5")
    assert "quadratic_damping at x, ground:" in shown.stdout.splitlines()[0]
    refused = run("tell-apart", "data.csv", "found.json", "--pair", "2", code=2)
    assert "pair" in refused.stderr


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("cubic.toml",), "two models"),
        (("cubic.toml", "plain.toml", "plain.toml"), "two models"),
        (("cubic.toml", "plain.toml", "--noise", "x"), "NAME=SIZE"),
        (("cubic.toml", "plain.toml", "--noise", "x=much"), "SI units"),
        (("cubic.toml", "plain.toml", "--limit", "G=3"), "one of F, x"),
        (("cubic.toml", "plain.toml", "--plot", "told.doc"), "told.doc"),
    ],
)
def test_bad_input_ends_with_code_2(arguments, message, two_models):
    before = contents(two_models)
    assert message in run("tell-apart", "data.csv", *arguments, "--no-fit", code=2).stderr
    assert contents(two_models) == before


def test_frequency_responses_do_not_tell(two_models):
    (two_models / "response.csv").write_text(responses())
    for command in (
        ("tell-apart", "response.csv", "cubic.toml", "plain.toml"),
        ("diagnose", "response.csv", "--model", "plain.toml"),
    ):
        told = run(*command, code=2).stderr
        assert "signals over time" in told
        assert "refit take frequency responses" in told


# How measurements are read.


def measured(output="x"):
    ground = ("x", "ground")
    return rp.MechanicalModel(
        [rp.Dof("x", 1.0)], inputs=[rp.Input("F", ground)], outputs=[rp.Output(output, ground)]
    )


@pytest.fixture
def path(tmp_path):
    time = np.arange(200) / 100
    columns = (np.sin(9 * time), np.cos(7 * time), np.full(200, 20.0))
    (tmp_path / "a.csv").write_text(csv("F,x,T", *columns))
    return str(tmp_path / "a.csv")


def test_only_what_the_model_needs_is_read_in_the_units_given(path):
    data = load_data(path, measured(), Reading(sampling_rate=100.0, units=("F=kN", "x=mm")))
    assert set(data.data_vars) == {"F", "x"}  # the constant temperature is no signal
    assert float(data["x"][0]) == pytest.approx(1e-3)
    assert float(abs(data["F"]).max()) == pytest.approx(1e3, rel=1e-2)
    assert data["time"].values[1] == pytest.approx(0.01)


def test_several_files_are_read_alike_and_go_by_their_names(path, tmp_path):
    other, same = tmp_path / "b.csv", tmp_path / "again" / "a.csv"
    same.parent.mkdir()
    for copy in (other, same):
        copy.write_text(Path(path).read_text())
    reading = Reading(sampling_rate=100.0, between=(0.5, 1.0), units=("F=kN", "x=mm"))
    found = load_records((path, str(other)), measured(), reading)
    assert list(found) == ["a", "b"]
    for data in found.values():
        assert data.sizes["time"] == 51
        assert float(abs(data["F"]).max()) > 100
    assert list(load_records((path, str(same)), measured(), reading)) == [path, str(same)]
    with pytest.raises(InvalidInputError, match=r"a.csv twice, expected each file once"):
        load_records((path, path), measured(), reading)


def test_only_json_of_an_earlier_run_is_replaced(tmp_path):
    out, data = str(tmp_path / "out.json"), str(tmp_path / "data.json")
    assert replaceable(out, data)
    assert not replaceable(data, data)
    assert not replaceable(str(tmp_path / "sub" / ".." / "data.json"), data)
    assert not replaceable(str(tmp_path / "out.csv"), data)


def test_a_record_of_the_brush_on_a_bearing_that_hides_something(tmp_path):
    hidden, record = str(tmp_path / "hidden.toml"), str(tmp_path / "record.csv")
    run("model", "air-bearing", "--add", "coulomb_friction y ground force=0.3", "--out", hidden)
    (effect,) = MechanicalModel.from_toml(Path(hidden)).effects
    assert (effect.kind, effect.at, effect.values["force"]) == (
        "coulomb_friction", ("y", "ground"), 0.3,
    )  # fmt: skip
    run("brush", "--duration", "0.05", "--model", hidden, "--seed", "3", "--out", record)
    told = json.loads(run("compare", record, "--model", "air-bearing", "--json").stdout)
    assert set(told["outputs"]) == {"x", "y", "z"}  # F_p stands still, the bearing has no sensors
    assert told["outputs"]["x"]["nrmse"] < 0.05 < told["outputs"]["y"]["nrmse"]
    # the band of the record ends at 10 kHz, the printed bearing has a mode at 27 kHz
    printed = run("compare", record, "--model", "air-bearing:as-printed").stdout
    assert "does not show the model's mode at 2" in printed
    fewer = run("compare", record, "--model", hidden, "--columns", "x, y", "--json")
    assert set(json.loads(fewer.stdout)["outputs"]) == {"x", "y"}
    for columns, message in (("x,w", "'w'"), ("x,x_m", "'x_m'")):
        result = run("compare", record, "--model", hidden, "--columns", columns, code=2)
        assert message in result.stderr
    for change, message in (("force=2", "a place"), ("cubic_stiffness y force=much", "numbers")):
        assert message in run("model", "air-bearing", "--add", change, code=2).stderr


@pytest.mark.parametrize("command", ["compare", "refit", "try", "diagnose", "tell-apart"])
def test_every_command_on_measurements_takes_columns(command):
    assert "--columns" in run(command, "--help").stdout


@pytest.mark.parametrize("command", ["modes", "norms"])
def test_the_air_bearing_is_known_by_its_name(command):
    named = run(command, "--model", "air-bearing:as-printed", "--json").stdout
    assert json.loads(named)[command if command == "modes" else "hinf"]
    assert "as-" in run(command, "--model", "air-bearing:as-drawn", code=2).stderr
