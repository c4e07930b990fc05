"""Public calls take short ways through the files."""

import sys

import pytest

import robustpolish as rp

from .call_path import design_for_four_states, design_for_two_states, diagnosis, path_of

# Half of what it was when one idea was spread over many files: 43. One is that which finds signals
# of a plant by name, one the norm that is asked for (gamma), one takes whatever users call a
# controller (a loop refused transfer functions without it), and four prove the lower bound in long
# arithmetic (the search, the disc, the equations, their columns): bounds were false without that.
# One scales by powers of two exactly or refuses: absurd numbers became infinite or zero without it.
# One is the deadline that proofs look at: certificates outlasted time_limit by seconds. One
# searches a part, with fewer states where it is large: the public function's file was too long.
MOST_FILES_OF_A_DESIGN = 31
# It was 20 functions; this is what is left of them, lest it grow again.
MOST_DEPTH_OF_A_DESIGN = 15
# It was 79 files, effects that are tried included; they are not counted: each has its own. So has
# each warning about a record. It was 40 until a diagnosis also said what looks wrong about its
# record, mapped what is left, told of every candidate why it was not refitted, took several
# records at once, thinned long ones, took a second look at what it found, let friction hold,
# settled the damping of decays, and took inputs between samples as they are. Three were parts of
# its end, the longest file of all: the final fit, the verdict, and a law in place of names.
MOST_FILES_OF_A_DIAGNOSIS = 67
OF_THEIR_OWN = ("effects/catalogue/", "identification/sanity/")


@pytest.mark.parametrize("call", [design_for_two_states, design_for_four_states])
def test_a_design_goes_through_few_files(call):
    path = path_of(call)
    assert len(path.files) <= MOST_FILES_OF_A_DESIGN, sorted(path.files)


@pytest.mark.parametrize("call", [design_for_two_states, design_for_four_states])
def test_a_design_does_not_go_deep(call):
    path = path_of(call)
    assert len(path.deepest) <= MOST_DEPTH_OF_A_DESIGN, path.deepest


def test_a_diagnosis_goes_through_few_files():
    diagnosis()  # what is loaded at first use is no part of the way
    path = path_of(diagnosis)
    files = {file for file in path.files if not file.startswith(OF_THEIR_OWN)}
    assert len(files) <= MOST_FILES_OF_A_DIAGNOSIS, sorted(files)
    assert len(files) > 20  # the way was followed


def test_the_way_of_a_small_call_is_what_it_says():
    plant = rp.GeneralizedPlant.from_matrices([[-1]], [[1]], [[1]], [[1]], [[1]])
    path = path_of(lambda: plant.nx)
    (file,), (function,) = path.files, path.deepest
    assert function.startswith(f"{file}: ")
    assert function.endswith(".nx")
    assert not path.returns
    assert sys.getprofile() is None


def test_ways_that_come_back_are_told(tmp_path, monkeypatch):
    (tmp_path / "a.py").write_text(
        "import b\ndef start(): return b.middle()\ndef end(): return 1\n"
    )
    (tmp_path / "b.py").write_text(
        "def help(): return 1\nhelp()\n"
        "def middle():\n    import a\n    return help() + sorted([1], key=lambda _: a.end())[0]\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr(rp, "__file__", str(tmp_path / "__init__.py"))

    def call():
        import a

        return a.start()

    path = path_of(call)
    assert path.files == {"a.py", "b.py"}
    assert path.deepest == ("a.py: start", "b.py: middle", "b.py: middle.<locals>.<lambda>",
                            "a.py: end")  # fmt: skip
    assert path.returns == {("a.py", "b.py", "a.py")}


def test_a_failing_call_leaves_no_watcher_behind():
    with pytest.raises(rp.InvalidInputError):
        path_of(lambda: rp.output_feedback("no plant"))
    assert sys.getprofile() is None
