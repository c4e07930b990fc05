"""What the subcommands share: strict JSON, messages and exit codes."""

import json

import click
import numpy as np
import pytest
from click.testing import CliRunner

from robustpolish.app.cli.options import brush_options, errors_to_exit_codes, print_result, to_json
from robustpolish.errors import InfeasibleError, InvalidInputError
from tests.cli.command_line import run


def test_bad_input_ends_in_a_message(tmp_path):
    assert "duration: got -1.0" in run("brush", "--duration", "-1", code=2).stderr
    assert "dissipation" in run("norms", "--dissipation", "nan", code=2).stderr
    assert "out: got" in run("brush", "--out", str(tmp_path / "a.xyz"), code=2).stderr
    assert list(tmp_path.iterdir()) == []


def test_json_is_strict():
    content = {
        "array": np.array([1.0, np.inf, -np.inf, np.nan]), "scalar": np.float64(2.5),
        "whole": np.int64(3), "true": np.True_, "pole": -1 + 2j, "pair": (1, "a"), 4: None,
    }  # fmt: skip
    assert json.loads(to_json(content)) == {
        "array": [1.0, "inf", "-inf", None], "scalar": 2.5, "whole": 3, "true": True,
        "pole": {"real": -1.0, "imag": 2.0}, "pair": [1, "a"], "4": None,
    }  # fmt: skip


def test_a_file_is_replaced_only_by_force(tmp_path, capsys):
    path = tmp_path / "a.json"
    print_result({"a": 1}, "one", str(path))
    assert capsys.readouterr().out == "one\n"
    with pytest.raises(InvalidInputError, match="expected a file that does not exist yet"):
        print_result({"a": 2}, "two", str(path))
    assert json.loads(path.read_text()) == {"a": 1}
    assert capsys.readouterr().out == ""
    print_result({"a": 2}, "two", str(path), force=True)
    assert json.loads(path.read_text()) == {"a": 2}


@pytest.mark.parametrize(
    ("error", "code"), [(InvalidInputError("a: bad"), 2), (InfeasibleError("none exists"), 1)]
)
def test_errors_of_the_package_become_exit_codes(error, code, capsys):
    @errors_to_exit_codes
    def command():
        raise error

    with pytest.raises(SystemExit) as ended:
        command()
    assert ended.value.code == code
    assert capsys.readouterr().err == f"Error: {error}\n"


def test_a_defect_of_the_program_keeps_its_traceback():
    @errors_to_exit_codes
    def command():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        command()


def test_the_options_of_a_run_of_the_brush():
    @click.command()
    @brush_options
    def command(run, simulator, duration):
        click.echo(f"{run} {simulator} {duration}")

    assert CliRunner().invoke(command, []).output == "1 physical 5.0\n"
    given = ["--run", "4", "--simulator", "listing", "--duration", "0.5"]
    assert CliRunner().invoke(command, given).output == "4 listing 0.5\n"
    refused = CliRunner().invoke(command, ["--run", "5"])
    assert refused.exit_code == 2
    assert "1<=x<=4" in refused.output
