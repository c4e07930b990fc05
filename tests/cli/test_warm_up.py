"""`robustpolish warm-up`: what is compiled once is compiled then."""

import os
import subprocess
import sys

import pytest
from click.testing import CliRunner

from robustpolish.app.cli.main import main
from robustpolish.app.cli.warm_up import CALLS

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
load = rp.simulate_brush(run=1, duration=0.02)
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
