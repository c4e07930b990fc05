"""The C file, compiled with every warning an error, against the Python controller."""

import shutil
import subprocess

import numpy as np
import pytest

import robustpolish as rp
from robustpolish.implementation.export.files import number
from robustpolish.implementation.realization import anti_windup, control_limits, controller_outputs
from tests.implementation.designs import sampled_servo, static_gain, two_by_two

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler")
DESIGNS = {"servo": sampled_servo, "two by two": two_by_two, "gain": static_gain}


def compiled(source, *flags):
    program = source.with_suffix("")
    name = source.stem.upper()
    command = ["cc", "-Wall", "-Wextra", "-Werror", "-std=c99", "-pedantic", "-O2", *flags]
    subprocess.run([*command, f"-D{name}_MAIN", "-o", program, source], check=True)
    return program


def ran(program, y):
    text = "\n".join(" ".join(repr(float(v)) for v in row) for row in y)
    done = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    return np.array([[float(v) for v in line.split()] for line in done.stdout.splitlines()])


@pytest.mark.parametrize("name", DESIGNS)
@pytest.mark.parametrize("limits", [None, 0.3])
def test_doubles_agree_on_ten_thousand_samples(name, limits, tmp_path):
    sampled = DESIGNS[name]()
    source = sampled.export_c(tmp_path, name="loop", limits=limits, test_vectors=10_000)
    table = np.loadtxt(tmp_path / "loop_vectors.csv", delimiter=",", skiprows=1)
    ny = sampled.controller.ninputs
    y, u = table[:, :ny], table[:, ny:]
    assert len(y) == 10_000
    K = sampled.controller
    if limits is None:
        expected = controller_outputs(K, y)
    else:
        found = control_limits(limits, K.output_labels)
        expected = controller_outputs(K, y, found, anti_windup(K).L)
        assert np.abs(expected).max() == limits
    np.testing.assert_allclose(u, expected, rtol=1e-12, atol=1e-12 * np.abs(u).max())
    printed = ran(compiled(source), y)
    np.testing.assert_allclose(printed, u, rtol=1e-12, atol=1e-12 * np.abs(u).max())


@pytest.mark.parametrize(
    ("name", "form"),
    [
        ("servo", None), ("servo", "balanced"), ("servo", "modal"), ("servo", "sections"),
        ("two by two", "sections"), ("gain", None),
    ],
)  # fmt: skip
def test_single_precision_keeps_its_bound(name, form, tmp_path):
    sampled = DESIGNS[name]()
    if form is not None:
        sampled = sampled.realization(form)
    source = sampled.export_c(tmp_path, "loop", precision="float", test_vectors=10_000)
    table = np.loadtxt(tmp_path / "loop_vectors.csv", delimiter=",", skiprows=1)
    ny = sampled.controller.ninputs
    printed = ran(compiled(source), table[:, :ny])
    bound = sampled._single()
    error = np.abs(printed - table[:, ny:]).max(axis=0)
    assert (error <= bound.outputs).all()
    assert (error > 0).any() or sampled.controller.nstates == 0
    if form is not None:
        assert (bound.outputs < 0.05 * bound.size).all()
    assert "Single precision" in source.read_text()


def test_the_head_tells_what_a_reader_needs(tmp_path):
    sampled = sampled_servo()
    text = sampled.export_c(tmp_path / "my.c", name="servo", limits={"F": (-1.0, 2.0)}).read_text()
    head = text.split("*/")[0]
    for word in ("x [m]", "F [N]", "positive sign", "0.05", "0.02", "norm", "anti-windup"):
        assert word in head
    assert "malloc" not in text
    assert "servo_low[1] = {-1.0}" in text
    assert "servo_high[1] = {2.0}" in text


def test_what_does_not_fit_is_refused(tmp_path):
    sampled = sampled_servo()
    for bad in ("", "2loop", "a b", "for", "a-b", "_x", "x" * 60, None):
        with pytest.raises(rp.InvalidInputError, match="name"):
            sampled.export_c(tmp_path, name=bad)
    with pytest.raises(rp.InvalidInputError, match="precision"):
        sampled.export_c(tmp_path, precision="half")
    with pytest.raises(rp.InvalidInputError, match="limits"):
        sampled.export_c(tmp_path, limits={"G": 1.0})
    with pytest.raises(rp.InvalidInputError, match="limits"):
        sampled.export_c(tmp_path, limits=-1.0)
    with pytest.raises(rp.InvalidInputError, match="folder"):
        sampled.export_c(tmp_path / "none")
    sampled.export_c(tmp_path)
    with pytest.raises(rp.InvalidInputError, match="force"):
        sampled.export_c(tmp_path)
    sampled.export_c(tmp_path, force=True)


def test_names_of_signals_cannot_end_the_comment(tmp_path):
    plant = rp.GeneralizedPlant.from_matrices(
        [[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]], controls=["u*/ int x;"], measurements=["µ\n"]
    )
    sampled = rp.given_controller(plant, [[-3.0]]).discretize(0.1)
    compiled(sampled.export_c(tmp_path, "odd"))


def test_vectors_reach_limits_in_their_second_half_only(tmp_path):
    sampled = two_by_two()
    sampled.export_c(tmp_path, name="loop", limits=1e-3, test_vectors=200)
    table = np.loadtxt(tmp_path / "loop_vectors.csv", delimiter=",", skiprows=1)
    u = np.abs(table[:, sampled.controller.ninputs :])
    assert u[:100].max() == pytest.approx(0.5e-3)
    assert (u[100:] == 1e-3).mean() > 0.5


def test_infinite_limits_become_the_largest_number():
    assert float(number(float("inf"), "double")) == 1.7976931348623157e308
    assert number(float("-inf"), "float") == "-3.40282347e+38f"
