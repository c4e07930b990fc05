"""Results show themselves in one way, with SI prefixes, and name their version."""

import math
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from click.shell_completion import BashComplete

import robustpolish as rp
from robustpolish.app.cli.main import main
from robustpolish.base.results import (
    Card,
    Displayed,
    Table,
    bears_prefix,
    estimate,
    prefix_power,
    prefixed,
    quantities,
    shown,
)


class Answer(Displayed):
    def _card(self):
        table = Table("Forces", ("name", "value [N]"), (("F <x>", 12.34567), ("F_long", None)))
        return Card("Answer", (table, quantities(("sound", True))), ("A & B.",))


def test_text_is_aligned_and_numbers_are_flush_right():
    assert repr(Answer()) == str(Answer())
    assert repr(Answer()).splitlines() == [
        "Answer",
        "  Forces",
        "  name    value [N]",
        "  F <x>       12.35",
        "  F_long          -",
        "  sound  yes",
        "  A & B.",
    ]


def test_html_is_one_block_of_tables_and_escaped():
    page = Answer()._repr_html_()
    assert page.count("<table>") == 2
    assert "<strong>Answer</strong>" in page
    assert "<caption>Forces</caption>" in page
    assert '<td>F &lt;x&gt;</td><td style="text-align: right">12.35</td>' in page
    assert "<p>A &amp; B.</p>" in page


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (float("nan"), "-"),
        (None, "-"),
        (float("inf"), "inf"),
        (True, "yes"),
        (12, "12"),
        (0.000123456, "0.0001235"),
        ((1.0, "a"), "1, a"),
        (1 + 2j, "1+2j"),
    ],
)
def test_cells(value, text):
    assert shown(value) == text


@pytest.mark.parametrize(
    ("value", "error", "texts"),
    [
        (12.3456, 0.034, ["12.346", "0.034"]),
        (12.3456, 0.0996, ["12.35", "0.10"]),  # rounds up to a further place
        (0.2, 35.4, ["0", "35"]),
        (123456.7, 89.0, ["123457", "89"]),
        (123456.7, 891.0, ["1.2346e+05", "8.9e+02"]),
        (4e6, 1e5, ["4.00e+06", "1.0e+05"]),
        (-2.345e-7, 1.2e-9, ["-2.345e-07", "1.2e-09"]),
        (0.0, 1.2e-9, ["0.0e+00", "1.2e-09"]),
        (1.0, 1e-20, ["1.000000000e+00", "1.0e-20"]),
    ],
)
def test_a_value_ends_where_its_standard_error_does(value, error, texts):
    cells = estimate(value, error)
    assert cells == (value, error)
    assert [shown(cell) for cell in cells] == texts


@pytest.mark.parametrize("error", [0.0, math.inf, math.nan])
def test_a_value_without_a_known_error_stays_as_it_is(error):
    assert shown(estimate(1.23456789, error)[0]) == "1.235"


@pytest.mark.parametrize(
    ("size", "unit"),
    [(2.1e-5, "µm"), (999.0, "m"), (1000.0, "km"), (3.0, "m"), (0.5, "mm"), (0.0, "m"),
     (math.inf, "m"), (1e-40, "qm"), (1e40, "Qm")],
)  # fmt: skip
def test_the_prefix_suits_the_size(size, unit):
    assert prefixed("m", prefix_power(size)) == unit


def test_powers_and_units_with_a_prefix_bear_none():
    bear = ("m", "N/m", "N m", "Nm", "V", "Ω", "rad/s", "m/s^2", "N*s/m")
    none = ("", "1", "%", "1/s", "m^2", "m**2", "kg", "mm", "mm/s", "kN", "ms", "deg", "min", "rpm")
    assert [unit for unit in bear if not bears_prefix(unit)] == []
    assert [unit for unit in none if bears_prefix(unit)] == []


ROOT = Path(__file__).resolve().parents[2]


def test_package_and_project_agree():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert rp.__version__ == project["version"]


def test_versions_name_what_a_report_needs(capsys):
    rp.show_versions()
    shown = dict(
        line.split(maxsplit=1) for line in capsys.readouterr().out.splitlines()[1:] if " " in line
    )
    assert shown["robustpolish"] == rp.__version__
    assert shown["Python"].startswith(f"{sys.version_info.major}.{sys.version_info.minor}")
    for name in ("numpy", "scipy", "control", "cvxpy", "xarray", "matplotlib"):
        assert shown[name][0].isdigit()


def test_the_module_runs_as_a_command():
    command = [sys.executable, "-m", "robustpolish", "--version"]
    told = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert told.stdout.strip() == f"robustpolish, version {rp.__version__}"


def test_the_shell_completes_commands_and_options():
    complete = BashComplete(main, {}, "robustpolish", "_robustpolish_COMPLETE")
    assert {"design", "diagnose"} == {c.value for c in complete.get_completions([], "d")}
    assert "--report" in {c.value for c in complete.get_completions(["design"], "--r")}
    found = complete.get_completions(["design", "--norm"], "")
    assert {c.value for c in found} == {"hinf", "h2"}
