"""Fixtures that all tests share."""

import warnings
from pathlib import Path

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.polishing import design as limits_of_hardware
from robustpolish.polishing.design import BuildableBrushDesign

from .times import Marks, Measure

SHARED = Path(__file__).resolve().parents[2] / "shared"


def pytest_addoption(parser):
    parser.addoption("--measure-times", action="store_true", help="write tests/slow.txt")


def pytest_configure(config):
    config.pluginmanager.register(Marks())
    if config.getoption("--measure-times"):
        config.pluginmanager.register(Measure())


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder with measurements and benchmark plants beside the checkout."""
    if not SHARED.is_dir():
        pytest.skip("the folder ../shared with measurements and benchmarks is not here")
    return SHARED


@pytest.fixture
def overflows_are_expected():
    """Warnings of NumPy are what absurd numbers look like on the way to an answer."""
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        yield


@pytest.fixture(scope="session")
def buildable_job() -> BuildableBrushDesign:
    """The default design against the brush, of one relaxed limit instead of four."""
    job = rp.polishing.design_against_brush(duration=0.02)
    assert isinstance(job, BuildableBrushDesign)
    all_relaxed = limits_of_hardware.relaxed_hardware
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            limits_of_hardware, "relaxed_hardware", lambda hardware: [*all_relaxed(hardware)][-1:]
        )
        assert job.limits  # they stay with the job
    return job
