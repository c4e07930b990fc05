"""The answers of the package are the frozen ones; `python -m tests.reference.freeze --help`."""

import json
import subprocess
import sys

import pytest

from tests.reference.freeze import ANSWERS, MACHINE, TIMINGS, environment
from tests.reference.plain import array, differences, keys, plain
from tests.reference.program_subjects import short
from tests.reference.subjects import SUBJECTS

ROOT = ANSWERS.parents[2]
QUICK = 5.0  # seconds of the processor


def marked(name):
    spent = sum(t["processor"] for t in json.loads(TIMINGS.read_text()).get(name, {}).values())
    marks = [pytest.mark.timeout(3600)]
    if spent > QUICK:
        marks.append(pytest.mark.long)
    if SUBJECTS[name].shared:
        marks.append(pytest.mark.shared)
    return pytest.param(name, marks=marks)


@pytest.mark.parametrize("name", [marked(name) for name in SUBJECTS])
def test_answers_are_as_they_were(name):
    """To the bit where they were frozen; with other libraries or processors to a thousandth."""
    if not SUBJECTS[name].available():
        pytest.skip("the folder ../shared with measurements and benchmarks is not here")
    command = [sys.executable, "-m", "tests.reference.freeze", "--check", name]
    if environment() != json.loads(MACHINE.read_text()):
        command += ["--tolerance", "1e-3"]
    done = subprocess.run(command, check=False, capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, f"{done.stdout[-8000:]}\n{done.stderr[-2000:]}"


@pytest.mark.parametrize("name", SUBJECTS)
def test_there_are_answers(name):
    assert json.loads((ANSWERS / f"{name}.json").read_text())


def test_nothing_but_errors_of_the_package_was_frozen():
    for file in ANSWERS.iterdir():
        assert '"unexpected": true' not in file.read_text()


@pytest.mark.parametrize("value", [0.1, -0.0, float("inf"), float("nan"), 5e-324, 1 / 3])
def test_every_bit_comes_back(value):
    again = json.loads(json.dumps(plain({"a": value})))
    assert not differences({"a": value}, again)


def test_one_bit_is_a_difference():
    values = [float(i) for i in range(20)]
    other = [*values[:-1], 19.000000000000004]
    assert differences({"a": 0.1}, {"a": 0.10000000000000002})
    assert differences({"a": 0.0}, {"a": -0.0})
    assert differences({"a": array(values)}, {"a": array(other)})
    assert not differences({"a": array(values)}, {"a": array(other)}, 1e-3)


def test_what_is_missing_or_new_is_a_difference():
    assert differences({"a": 1, "b": 2}, {"a": 1}) == ['b: 2 -> "(nothing)"']
    assert differences({"a": 1}, {"a": 1, "b": 2}) == ['b: "(nothing)" -> 2']


def test_with_a_tolerance_norms_may_get_better_and_not_worse():
    before = {"status": "optimal", "achieved": 1.0, "bound": 1.001, "lower": 1.0}
    assert not differences(before, before | {"achieved": 0.9, "lower": 1.1}, 1e-3)
    assert not differences(before, before | {"achieved": 1.0005}, 1e-3)
    assert differences(before, before | {"achieved": 1.002}, 1e-3)
    assert differences(before, before | {"bound": 1.1}, 1e-3)
    assert differences(before, before | {"lower": 0.9}, 1e-3)
    assert differences(before, before | {"status": "suboptimal"}, 1e-3)


def test_keys_of_json():
    assert keys({"a": [{"b": 1}, {"c": 2}], "d": {}}) == ["a", "a[]", "a[].b", "a[].c", "d"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("(a: 'robustpolish.plants.Plant | None' = 1.5)", "(a: 'Plant | None' = 1.5)"),
        ("(f=<function a.b at 0x7f00>, name: str = 'x')", "(f=<function b>, name: str = 'x')"),
    ],
)
def test_modules_are_left_out_of_signatures(text, expected):
    assert short(text) == expected
