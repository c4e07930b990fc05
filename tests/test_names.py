"""Names of version 0.1.0 still mean what they meant; those of other toolboxes are answered."""

import importlib
import json
import warnings
from pathlib import Path
from types import ModuleType

import pytest

import robustpolish as rp
from robustpolish import names

ANSWERS = Path(__file__).parent / "reference" / "answers"
OLD = json.loads((Path(__file__).parent / "names_of_0_1_0.json").read_text())
PACKAGES = json.loads((ANSWERS / "rooms.json").read_text())


def resolved(get):
    """Return what a name means now, and the warnings about it, which point at this file."""
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always", DeprecationWarning)
        found = get()
    ours = [warning for warning in told if "robustpolish" in str(warning.message)]
    assert all(warning.filename == __file__ for warning in ours)
    return found, [str(warning.message) for warning in ours]


def test_every_old_name_at_the_top_resolves_with_a_warning():
    moved = [name for name in OLD if name not in rp.__all__]
    assert len(moved) > 100
    for name in moved:
        found, told = resolved(lambda name=name: getattr(rp, name))
        if isinstance(found, ModuleType):  # the function tunable is its module now
            assert callable(found), name
            continue
        assert found is not None
        assert len(told) == 1, f"{name}: {told}"
        assert told[0].startswith(f"robustpolish.{name} is now robustpolish.")
        assert "goes with version 0.3" in told[0]


def test_the_module_tunable_is_still_the_function():
    block, told = resolved(lambda: rp.tunable("k", 10.0, low=0.0, high=1e4))
    assert block == rp.tunable.tunable("k", 10.0, low=0.0, high=1e4)
    assert told == ["robustpolish.tunable(...) is now robustpolish.tunable.tunable(...)"]


@pytest.mark.parametrize("package", PACKAGES)
def test_old_packages_are_importable_with_their_names(package):
    module = importlib.import_module(f"robustpolish.{package}")
    missing = []
    for name in PACKAGES[package]:
        try:
            found, told = resolved(lambda name=name: getattr(module, name))
        except AttributeError:
            missing.append(name)
            continue
        assert found is not None
        if package in names.OLD_PACKAGES:
            assert any(text.startswith(f"robustpolish.{package}.{name} is now") for text in told)
    assert missing == []
    with pytest.raises(AttributeError, match="no_such_name"):
        module.no_such_name  # noqa: B018


@pytest.mark.parametrize(
    ("name", "ours"),
    [("hinfsyn", "output_feedback"), ("lqr", "state_feedback"), ("bode", "plots.plot_bode")],
)
def test_names_of_other_toolboxes_are_answered_with_ours(name, ours):
    with pytest.raises(AttributeError, match=rf"no attribute '{name}'; use rp\.{ours}\("):
        getattr(rp, name)


@pytest.mark.parametrize("name", names.other_toolboxes())
def test_what_is_proposed_exists(name):
    found = rp
    for part in names.other_toolboxes()[name].partition("(")[0].split("."):
        found = getattr(found, part)
    assert callable(found)


def test_what_nobody_ever_offered_is_an_attribute_error():
    with pytest.raises(AttributeError, match=r"no attribute 'no_such_name'$"):
        rp.no_such_name  # noqa: B018
