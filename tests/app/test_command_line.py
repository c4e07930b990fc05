"""What the commands share: help, options, stages, JSON, exit codes, places that are taken."""

import json
import os
import pty
import signal
import subprocess
import sys
import termios
import time

import click
import numpy as np
import pytest
from click.testing import CliRunner

import robustpolish as rp
from robustpolish.app.cli.design import command_with_any_machine
from robustpolish.app.cli.main import main
from robustpolish.app.cli.options import (
    READINGS,
    errors_to_exit_codes,
    print_result,
    stages,
    to_json,
)
from robustpolish.app.cli.warm_up import CALLS
from robustpolish.errors import InfeasibleError, InvalidInputError
from tests.app.command_line import run
from tests.busy import output_of


def test_help_and_bad_input(tmp_path):
    text = run("--help").stdout
    for command in ("design", "modes", "norms", "brush"):
        assert command in text
        assert "Usage" in run(command, "--help").stdout
    assert rp.__version__ in run("--version").stdout
    assert "No such command" in run("nonsense", code=2).stderr
    assert "duration: got -1.0" in run("brush", "--duration", "-1", code=2).stderr
    assert "dissipation" in run("norms", "--dissipation", "nan", code=2).stderr
    assert "out: got" in run("brush", "--out", str(tmp_path / "a.xyz"), code=2).stderr
    assert list(tmp_path.iterdir()) == []


def test_a_command_without_a_model_says_where_its_machine_comes_from():
    for command, says in {"export": "--design", "tell-apart": "arguments"}.items():
        message = run(command, "--model", "m.toml", code=2).stderr
        assert "No such option" in message
        assert says in message
        assert "Did you mean" not in message


@pytest.mark.filterwarnings("default::robustpolish.RobustPolishWarning")
def test_a_warning_is_a_note_that_is_told_once(tmp_path):
    file = str(tmp_path / "rubs.toml")
    run("model", "air-bearing", "--add", "coulomb_friction y ground force=0.3", "--out", file)
    (line,) = run("norms", "--model", file).stderr.splitlines()
    assert line.startswith("Note: coulomb_friction at y, ground jumps at rest")


def test_help_imports_no_subcommand():
    """Help stays quick because nothing else is imported for it."""
    program = (
        "import sys, robustpolish.app.cli.main\n"
        "robustpolish.app.cli.main.main(['--help'], standalone_mode=False)\n"
        "names = {name for name in sys.modules if name.startswith('robustpolish.app.cli.')}\n"
        "assert names == {'robustpolish.app.cli.main'}, names\n"
    )
    output_of(program)


def test_json_is_strict_and_replaced_only_by_force(tmp_path, capsys):
    content = {
        "array": np.array([1.0, np.inf, -np.inf, np.nan]), "scalar": np.float64(2.5),
        "whole": np.int64(3), "true": np.True_, "pole": -1 + 2j, "pair": (1, "a"), 4: None,
    }  # fmt: skip
    assert json.loads(to_json(content)) == {
        "array": [1.0, "inf", "-inf", None], "scalar": 2.5, "whole": 3, "true": True,
        "pole": {"real": -1.0, "imag": 2.0}, "pair": [1, "a"], "4": None,
    }  # fmt: skip
    path = tmp_path / "a.json"
    print_result({"a": 1}, "one", str(path))
    assert capsys.readouterr().out == "one\n"
    with pytest.raises(InvalidInputError, match="expected a file that does not exist yet"):
        print_result({"a": 2}, "two", str(path))
    assert json.loads(path.read_text()) == {"a": 1}
    assert capsys.readouterr().out == ""
    print_result({"a": 2}, "two", str(path), force=True)
    assert json.loads(path.read_text()) == {"a": 2}


def test_errors_of_the_package_become_exit_codes_and_defects_keep_their_traceback(capsys):
    for error, code in ((InvalidInputError("a: bad"), 2), (InfeasibleError("none exists"), 1)):
        with pytest.raises(SystemExit) as ended, errors_to_exit_codes():
            raise error
        assert ended.value.code == code
        assert capsys.readouterr().err == f"Error: {error}\n"
    with pytest.raises(ZeroDivisionError), errors_to_exit_codes():
        raise ZeroDivisionError


def test_an_unknown_reading_is_refused_with_the_choices():
    told = run("modes", "--parameters", "guessed", code=2).output
    assert all(reading in told for reading in READINGS)


@click.command("look")
@click.option("--model")
@click.option("--plant")
@click.option("--far", is_flag=True)
def other(model, plant, far):
    click.echo(f"other {model} {plant} {far}")


@click.command(cls=command_with_any_machine(other))
@click.option("--near", is_flag=True)
def look(near):
    click.echo(f"own {near}")


CALLED = {
    "": "own False",
    "--near": "own True",
    "--model m --far": "other m None True",
    "--plant=p": "other None p False",
    "--far": "It needs --model or --plant.",
    "--model m --near": "It is one of the polishing robot.",
    "--neither": "No such option",
    "--help": "For any other machine",
    "--model m --help": "--far",
}


def test_who_is_called():
    for arguments, says in CALLED.items():
        assert says in CliRunner().invoke(look, arguments.split()).output


def test_commands_say_that_there_is_a_sibling():
    for command in ("design", "modes", "norms"):
        said = run(command, "--help").stdout.replace("main", "robustpolish")
        assert f"robustpolish {command} --model" in said
        assert "--plant" in run(command, "--model", "m.toml", "--help").stdout


DRIVER = """
import time
from robustpolish.base import budget
from robustpolish.app.cli.options import stages
budget.PROGRESS_DELAY = 0.05
with stages("Designing") as tell:
    tell("Certifying the loop ...")
    print("ready", flush=True)
    time.sleep({seconds})
"""


def _on_a_terminal(seconds):
    """Start a command whose standard error is a terminal; return it and the terminal."""
    ours, theirs = pty.openpty()
    termios.tcsetwinsize(theirs, (24, 100))  # a new one has no columns, and so shows nothing
    process = subprocess.Popen(
        [sys.executable, "-c", DRIVER.format(seconds=seconds)],
        stdout=subprocess.PIPE,
        stderr=theirs,
        # whoever starts the tests in the background has them ignore the signal
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    os.close(theirs)
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    return process, ours


def _read(terminal):
    shown = b""
    try:
        while part := os.read(terminal, 4096):
            shown += part
    except OSError:  # what Linux says when the other end is closed
        pass
    os.close(terminal)
    return shown.decode()


def test_a_terminal_shows_the_stage_in_a_bar_that_goes_away():
    process, terminal = _on_a_terminal(seconds=0.8)
    out, _ = process.communicate()
    shown = _read(terminal)
    assert "Designing 00:0" in shown
    assert "Certifying the loop" in shown
    assert "\n" not in shown
    assert out == b""


def test_ctrl_c_ends_a_command_at_once():
    process, terminal = _on_a_terminal(seconds=60)
    time.sleep(0.3)
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=30)
    assert "KeyboardInterrupt" in _read(terminal)
    assert process.returncode == -signal.SIGINT


def test_each_stage_is_a_line_where_no_bar_is_drawn(capsys):
    with stages("Designing") as tell:
        tell("Certifying the loop ...")
        tell("writing the report")
    assert capsys.readouterr().err == "Certifying the loop ...\n... writing the report\n"
    told = run("brush", "--duration", "0.02").stderr
    assert told == "Simulating 0.02 s of run 1 (physical) ...\n"


MISSING = "missing.json"
COMMANDS = {
    "brush": ("brush",),
    "compare": ("compare", "missing.csv", "--model", "missing.toml"),
    "design": ("design",),
    "design, any machine": ("design", "--model", "missing.toml"),
    "diagnose": ("diagnose", "missing.csv", "--model", "missing.toml"),
    "export": ("export", "--design", MISSING, "--period", "1e-3"),
    "margins": ("margins", "--design", MISSING),
    "modes": ("modes",),
    "modes, any machine": ("modes", "--model", "missing.toml"),
    "norms": ("norms",),
    "norms, any machine": ("norms", "--model", "missing.toml"),
    "refit": ("refit", "missing.csv", "--model", "missing.toml"),
    "tell-apart": ("tell-apart", "missing.csv", MISSING),
}


@pytest.fixture
def nothing_is_computed(monkeypatch, tmp_path):
    def computed(*_, **__):
        raise AssertionError("it was computed first")

    for what in ("brush.simulate_brush", "design.design_against_brush", "design.air_bearing"):
        monkeypatch.setattr(f"robustpolish.app.cli.{what}", computed)
    monkeypatch.chdir(tmp_path)


def refused(*arguments):
    told = run(*arguments, code=2).stderr
    assert "--force" in told
    assert "missing" not in told


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize("name", COMMANDS)
def test_json(name, tmp_path):
    # Not .json, which commands on measurements replace without being told to.
    (tmp_path / "taken.txt").write_text("mine")
    refused(*COMMANDS[name], "--json", "taken.txt")
    assert (tmp_path / "taken.txt").read_text() == "mine"


@pytest.mark.usefixtures("nothing_is_computed")
@pytest.mark.parametrize(
    ("name", "taken", "options"),
    [
        *((name, "taken.png", "--plot taken.png") for name in ("compare", "margins", "tell-apart")),
        *(
            ("export", f"controller{end}", "--out . --test-vectors 10")
            for end in (".c", "_vectors.csv")
        ),
    ],
)
def test_pictures_and_code(name, taken, options, tmp_path):
    (tmp_path / taken).write_text("mine")
    refused(*COMMANDS[name], *options.split())


WORK = """
import warnings
import control
import numpy as np
import robustpolish as rp
warnings.simplefilter("ignore")
model, data = rp.datasets.sticky_slide()
assert rp.diagnose(model, data.isel(time=slice(0, 800))).effects
plant = rp.air_bearing(actuation="force")
design = rp.state_feedback(plant, control_weight=1e-7)
load = rp.polishing.simulate_brush(run=1, duration=0.02)
rp.compare_controllers({"a": design}, load, signals=["x"])
rp.loop_analysis(design)
chain = np.diag(-np.arange(1.0, 21.0)) + 3 * np.eye(20, k=1) - 3 * np.eye(20, k=-1)
system = control.ss(chain, np.eye(20)[:, :2], np.eye(20)[-2:], 0)
for exact in (True, False):
    rp.hinf_norm(system, exact=exact)
rp.h2_norm(system)
"""


def test_every_call_is_made(monkeypatch):
    made = []
    for name in CALLS:
        monkeypatch.setitem(CALLS, name, lambda name=name: made.append(name))
    told = CliRunner().invoke(main, ["warm-up"])
    assert told.exit_code == 0, told.output
    assert "ready" in told.output
    assert made == list(CALLS)


@pytest.mark.long
def test_afterwards_nothing_is_compiled(tmp_path):
    def run(*arguments):
        told = subprocess.run(
            [sys.executable, *arguments],
            env=os.environ | {"XDG_CACHE_HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert told.returncode == 0, told.stderr
        return {path.relative_to(tmp_path) for path in tmp_path.rglob("*.nbc")}

    compiled = run("-m", "robustpolish", "warm-up")
    assert len(compiled) > 100
    assert run("-c", WORK) == compiled
