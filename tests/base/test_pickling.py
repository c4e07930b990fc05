"""Everything public can be pickled and copied, and comes back the same."""

import copy
import doctest
import inspect
import pickle
import sys
from dataclasses import is_dataclass
from types import MappingProxyType

import control
import flint
import matplotlib.pyplot as plt
import numpy as np
import pytest

import robustpolish as rp
from tests.busy import output_of

CLASSES = [
    found
    for name in rp.__all__
    if inspect.isclass(found := getattr(rp, name)) and is_dataclass(found)
]


def pickled(thing):
    return pickle.loads(pickle.dumps(thing))


@pytest.fixture(params=[pickled, copy.deepcopy, copy.copy], ids=["pickle", "deepcopy", "copy"])
def copied(request):
    return request.param


def test_a_system_keeps_its_names_and_gets_functions_of_its_own(copied):
    system = control.ss(
        [[-1.0, 1.0], [0.0, -2.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0, 0.1,
        inputs=["u"], outputs=["y"], states=["a", "b"], name="axis",
    )  # fmt: skip
    again = copied(system)
    assert again is not system
    assert str(again) == str(system)
    assert (again.name, again.dt, again.state_labels) == ("axis", 0.1, ["a", "b"])
    again.A = 2.0 * again.A
    np.testing.assert_array_equal(again.dynamics(0.0, [1.0, 1.0], [0.0]), [0.0, -4.0])
    np.testing.assert_array_equal(system.dynamics(0.0, [1.0, 1.0], [0.0]), [0.0, -2.0])


def test_states_without_use_stay(copied):
    idle = control.ss([[-1.0]], [[0.0]], [[0.0]], [[2.0]], remove_useless_states=False)
    assert copied(idle).nstates == 1


def test_a_mapping_that_cannot_be_changed_stays_one(copied):
    given = MappingProxyType({"one": [1.0]})
    again = copied(given)
    assert type(again) is MappingProxyType
    assert again == given


def test_balls_keep_every_bit(copied):
    rng, bits = np.random.default_rng(1), flint.ctx.prec
    try:
        for precision in (53, 100, 200):
            flint.ctx.prec = precision
            values = rng.normal(size=(40, 5)) * 10.0 ** rng.integers(-200, 200, (40, 5))
            matrix = flint.arb_mat(values.tolist())
            matrix = flint.arb_mat([[abs(entry).sqrt() for entry in matrix.entries()]]) / 3
            flint.ctx.prec = 53
            again = copied(matrix)
            assert (again.nrows(), again.ncols()) == (1, 200)
            for one, other in zip(matrix.entries(), again.entries(), strict=True):
                assert parts(one) == parts(other)
    finally:
        flint.ctx.prec = bits


def parts(ball):
    halves = ball.mid(), ball.rad()
    return tuple(part.man_exp() if part.is_finite() else float(part) for part in halves)


@pytest.mark.parametrize("value", [0.0, float("inf"), float("-inf")])
def test_balls_that_are_not_numbers(copied, value):
    assert parts(copied(flint.arb(value))) == parts(flint.arb(value))


def test_a_design_goes_to_another_process(tmp_path):
    plant = rp.GeneralizedPlant.from_matrices([[1.0]], [[1.0]], [[1.0]], [[1.0]], [[1.0]])
    design = rp.given_controller(plant, [[-3.0]])
    path = tmp_path / "design.pkl"
    path.write_bytes(pickle.dumps(design))
    program = f"import pickle; print(pickle.load(open({str(path)!r}, 'rb')))"
    assert output_of(program).strip() == str(design).strip()
    assert repr(pickled(design)) == repr(design)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Run all public examples and keep the last results of each public class that they made."""
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("examples"))
        for cls in CLASSES:
            patch.setattr(cls, "__init__", _kept(cls.__init__, found))
        runner = doctest.DocTestRunner(optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS)
        finder = doctest.DocTestFinder()
        for name in rp.__all__:
            thing = getattr(rp, name)
            module = sys.modules.get(getattr(thing, "__module__", ""))
            for example in finder.find(thing, name, module) if module else ():
                runner.run(example, out=lambda _: None)  # they are tested where they stand
                plt.close("all")
    return found


def _kept(build, found):
    def init(self, *args, **given):
        build(self, *args, **given)
        found[type(self)] = [*found.get(type(self), ())[-2:], self]

    return init


@pytest.mark.long
def test_examples_make_every_public_class(made):
    assert [cls.__name__ for cls in CLASSES if cls not in made] == []


@pytest.mark.long
def test_every_public_result_can_be_copied(made, copied):
    refused = {}
    for result in (result for results in made.values() for result in results):
        try:
            again = copied(result)
        except Exception as error:  # whatever stands in the way is reported
            refused[type(result).__name__] = str(error)
        else:
            assert type(again) is type(result)
            assert repr(again) == repr(result)
    assert refused == {}
