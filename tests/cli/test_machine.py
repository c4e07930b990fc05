"""The options that choose the machine."""

import click
import pytest
from click.testing import CliRunner

from robustpolish.app.cli.options import READINGS, machine_options


@click.command()
@machine_options
def chosen(reading: str, dissipation: float) -> None:
    """Tell what was chosen."""
    parameters = READINGS[reading]()
    click.echo(f"{parameters.bearing_mass:g} {parameters.inertia_reading} {dissipation:g}")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ([], "1.337 listing 0.001"),
        (["--parameters", "printed"], "0.337 listing 0.001"),
        (["--parameters", "corrected", "--dissipation", "0.01"], "1.337 physical 0.01"),
    ],
)
def test_a_reading_of_the_thesis_is_chosen(arguments, said):
    assert CliRunner().invoke(chosen, arguments).output.strip() == said


def test_an_unknown_reading_is_refused_with_the_choices():
    result = CliRunner().invoke(chosen, ["--parameters", "guessed"])
    assert result.exit_code == 2
    assert all(reading in result.output for reading in READINGS)
