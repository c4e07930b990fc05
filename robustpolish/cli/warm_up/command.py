"""`robustpolish warm-up`."""

from __future__ import annotations

import time
import warnings

import click

from robustpolish.cli.warm_up.first_calls import CALLS
from robustpolish.errors import RobustPolishWarning
from robustpolish.long_calls import working


@click.command("warm-up")
def warm_up() -> None:
    """Compile what is compiled on first use, and keep it for this user.

    Later runs of this version load it in a moment; once is enough.
    """
    start = time.perf_counter()
    with working("Compiling (once)", len(CALLS), stages=True) as tell, warnings.catch_warnings():
        warnings.simplefilter("ignore", RobustPolishWarning)  # of runs that nobody looks at
        for name, call in CALLS.items():
            tell(name)
            call()
    click.echo(f"Compiled code is ready ({time.perf_counter() - start:.1f} s).")
