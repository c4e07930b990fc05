"""Answers of the command line, of the validation page and of diagnoses; names and imports."""

from __future__ import annotations

import ast
import dataclasses
import enum
import importlib
import inspect
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import robustpolish as rp
from tests.machine_files import machine

from . import examples as ex
from .plain import digest, keys

Cases = Iterator[tuple[str, Callable[[], Any]]]
MACHINE = machine("slide")
CUBIC = """
[[effect]]
kind = "cubic_stiffness"
at = ["x", "ground"]
parameters = { stiffness = 2e7 }
"""
DESIGN = machine("slide_design")


def python(*arguments: str, code: int = 0) -> str:
    """Run a new Python with the package of this checkout and return what it prints."""
    path = os.pathsep.join(filter(None, (str(ex.ROOT), os.environ.get("PYTHONPATH", ""))))
    done = subprocess.run(
        [sys.executable, *arguments], check=False, capture_output=True, text=True,
        env=os.environ | {"PYTHONPATH": path, "MPLBACKEND": "Agg"},
    )  # fmt: skip
    if done.returncode != code:
        raise RuntimeError(f"ended with {done.returncode}: {done.stderr[-2000:]}")
    return done.stdout


def command(line: str, code: int = 0) -> Any:
    """Return the JSON of a subcommand, its structure and what else it wrote."""
    first = set(Path.cwd().iterdir())
    content = json.loads(python("-m", "robustpolish", *line.split(), "--json", code=code))
    made = sorted(path.name for path in set(Path.cwd().iterdir()) - first)
    return {"keys": keys(content), "content": _without_seconds(content), "files": made}


def _without_seconds(content: Any) -> Any:
    """Return JSON content without the times that something took."""
    if isinstance(content, dict):
        return {
            key: _without_seconds(entry)
            for key, entry in content.items()
            if key not in ("elapsed", "elapsed_seconds", "cpu_seconds")
        }
    if isinstance(content, list):
        return [_without_seconds(entry) for entry in content]
    return content


COMMANDS = (
    "modes",
    "modes --parameters corrected --dissipation 0.01",
    "norms",
    "brush --duration 0.5",
    "brush --simulator listing --run 4 --duration 0.05",
    "design --ideal --duration 0.1",
    "design --ideal --actuation displacement --norm h2 --duration 0.05",
    "design --duration 0.1",
    "modes --model machine.toml",
    "norms --model machine.toml",
    "design --model task.toml",
    "compare data.csv --model machine.toml --residuals",
    "compare data.csv --model cubic.toml --window 0.2",
    "refit data.csv --model cubic.toml --save fitted.toml",
    "diagnose data.csv --model machine.toml --save found.json",
    "tell-apart data.csv cubic.toml machine.toml --no-fit --noise x=1e-4",
    "margins --design servo.json",
    "export --design servo.json --period 0.05 --delay 0.02 --order 3 --form modal "
    "--limit F=-1:2 --name lag --to c --to mat --to json --test-vectors 10",
)


def commands() -> Cases:
    """Yield the JSON of every subcommand, on the polishing robot and on a small machine."""
    Path("machine.toml").write_text(MACHINE)
    Path("cubic.toml").write_text(MACHINE + CUBIC)
    Path("task.toml").write_text(MACHINE + DESIGN)
    data = ex.record(ex.hardening, 1500)
    columns = zip(*(data[name].values.tolist() for name in ("time", "F", "x")), strict=True)
    lines = [",".join(map(repr, row)) for row in columns]
    Path("data.csv").write_text("\n".join(["time [s],F [N],x [m]", *lines]) + "\n")
    ex.servo_design().save("servo.json", force=True)
    for line in COMMANDS:
        yield line, partial(command, line)
    yield "help", _help


def _help() -> Any:
    """Return what every --help says."""
    first = python("-m", "robustpolish", "--help")
    names = re.findall(r"^  ([a-z][a-z-]+)  ", first.split("Commands:")[1], re.M)
    told = {name: python("-m", "robustpolish", name, "--help").splitlines() for name in names}
    return {"robustpolish": first.splitlines()} | told


def page() -> Cases:
    """Yield the validation page, made anew in a copy of its folder."""
    yield "validation.md", _page


def _page() -> Any:
    docs = Path("docs")
    docs.mkdir()
    for file in (*(ex.ROOT / "docs").glob("*.py"), *(ex.ROOT / "docs").glob("*.md.in")):
        shutil.copy(file, docs)
    python(str(docs / "build_validation.py"))
    return comparable((docs / "validation.md").read_text(encoding="utf-8"))


# Rows of designs that search until a time limit of 20 s: they depend on the speed of the machine.
BY_THE_CLOCK = re.compile(
    r"\| (static output feedback|observer-based|(force|displacement) \| 1e-0\d, 1e-8) \|"
)


def comparable(text: str) -> dict[str, str]:
    """Return the lines of the page by number, without what depends on the clock."""
    lines = text.splitlines()
    # one column of one table is the time that its row took
    start = next((i for i, line in enumerate(lines) if "| CPU time" in line), len(lines))
    for i in range(start + 2, min(start + 4, len(lines))):
        cells = lines[i].split("|")
        lines[i] = "|".join([*cells[:2], " - ", *cells[3:]])
    masked = [f"{found[0]} ..." if (found := BY_THE_CLOCK.match(x)) else x for x in lines]
    return {f"{i:03d}": line for i, line in enumerate(masked, 1)}


HIDDEN = (
    "cubic, one mass", "quadratic damping", "q^2 v damping", "quadratic stiffness",
    "backlash, one mass", "stop, one mass", "constant force", "harmonic force", "input delay",
    "input gain", "sensor gain", "missing mode", "multisine, cubic", "nothing, one mass",
    "wrong numbers, two masses, in motion",
)  # fmt: skip


def hidden() -> Cases:
    """Yield some quick cases of the hidden effects, on shorter records."""
    from tests.hidden_effects.catalogue import all_cases

    found = {case.name: case for case in all_cases()}
    for name in HIDDEN:
        yield name, partial(_hidden, replace(found[name], samples=4000))


def _hidden(case: Any) -> Any:
    from tests.hidden_effects.cases import model_of, records

    (data, _), (unseen, _) = records(case)
    found = rp.diagnose(model_of(case), data)
    errors = rp.compare(found.model, unseen).outputs
    return {
        "verdict": found.verdict,
        "effects": [f"{effect.kind} at {', '.join(effect.at)}" for effect in found.effects],
        "alike": [f"{pair.first} / {pair.second}" for pair in found.indistinguishable],
        "numbers": {key: [v.value, v.stderr, v.unit] for key, v in found.parameters.items()},
        "candidates": [f"{c.kind} at {', '.join(c.at)}" for c in found.candidates],
        "errors": {name: error.rmse for name, error in errors.items()},
        "explained": digest(found.explain()),
    }


def signatures() -> Cases:
    """Yield every public name: what it takes, its fields, methods and properties."""
    yield "names", lambda: sorted(rp.__all__)
    for name in sorted(rp.__all__):
        yield name, partial(described, name)
    yield "kinds of effects", _kinds


def short(text: str) -> str:
    """Return a text without the modules that names come from, and without addresses."""
    text = re.sub(r" at 0x[0-9a-f]+", "", text)
    # a bound or default in quotes keeps its dots, such as 'robustpolish.effects'
    parts = re.split(r"""('[^']*'|"[^"]*")""", text)
    pattern = r"(?<![\w.])(?:[A-Za-z_]\w*\.)+(?=[A-Za-z_])"
    quoted = [part if i % 2 and "." not in part else re.sub(pattern, "", part)
              for i, part in enumerate(parts)]  # fmt: skip
    return "".join(quoted)


def signature(found: Any) -> str:
    """Return the signature as a text."""
    try:
        return short(str(inspect.signature(found)))
    except (TypeError, ValueError):
        return "none"


def described(name: str) -> Any:
    """Describe what is public of a function, class or module."""
    found = getattr(rp, name)
    if inspect.ismodule(found):
        names = getattr(found, "__all__", None) or [n for n in dir(found) if n[0] != "_"]
        inside = {entry: getattr(found, entry) for entry in sorted(names)}
        return {
            entry: signature(value) for entry, value in inside.items()
            if callable(value) and getattr(value, "__module__", "").startswith("robustpolish")
        }  # fmt: skip
    if not inspect.isclass(found):
        return {"kind": type(found).__name__, "signature": signature(found)}
    return _class(found)


def _class(found: type) -> Any:
    told: dict[str, Any] = {"kind": "class", "signature": signature(found)}
    told["bases"] = [base.__name__ for base in found.__mro__ if not _ours(base)][:1]
    if issubclass(found, enum.Enum):
        return told | {"members": [str(member.value) for member in found]}
    if dataclasses.is_dataclass(found):
        told["fields"] = {
            field.name: short(field.type if isinstance(field.type, str) else repr(field.type))
            for field in dataclasses.fields(found)
            if not field.name.startswith("_")
        }
    members = {}
    for base in reversed([base for base in found.__mro__ if _ours(base)]):
        members |= {n: m for n, m in vars(base).items() if not n.startswith("_")}
    told["members"] = {n: _member(m) for n, m in sorted(members.items()) if _told(m)}
    return told


def _ours(base: type) -> bool:
    return base.__module__.split(".")[0] == "robustpolish"


def _told(member: Any) -> bool:
    called = isinstance(member, classmethod | staticmethod | property) or callable(member)
    return called or hasattr(member, "func")


def _member(member: Any) -> str:
    if isinstance(member, classmethod | staticmethod):
        return f"{type(member).__name__} {signature(member.__func__)}"
    if isinstance(member, property):
        return f"property {signature(member.fget)}"
    if hasattr(member, "func"):
        return f"{type(member).__name__} {signature(member.func)}"
    return signature(member)


def _kinds() -> Any:
    from robustpolish import effects

    return {
        name: {
            parameter.name: short(repr(parameter.unit()))
            for parameter in kind.parameters
        }
        for name, kind in sorted(effects.kinds().items())
    }  # fmt: skip


ROOMS = (
    "analysis", "brush", "closed_loop", "datasets", "effects", "errors", "identification",
    "implementation", "loops", "machine_design", "measurements", "models", "plotting", "report",
    "robust", "simulation", "sweeps", "synthesis",
)  # fmt: skip


def rooms() -> Cases:
    """Yield the names that the packages inside offer; to be frozen anew if one is renamed."""
    for room in ROOMS:
        yield room, partial(_room, room)


def _room(room: str) -> Any:
    """Return the names of a package and their signatures; modules below are its own affair."""
    module = importlib.import_module(f"robustpolish.{room}")
    names = getattr(module, "__all__", None) or [n for n in dir(module) if n[0] != "_"]
    told = {}
    for name in sorted(set(names)):
        found = getattr(module, name)
        if inspect.ismodule(found):
            continue
        ours = getattr(found, "__module__", "").startswith("robustpolish")
        told[name] = signature(found) if callable(found) and ours else type(found).__name__
    return told


HEAVY = (
    "IPython", "clarabel", "control", "cvxpy", "flint", "h5py", "jinja2", "lmfit", "matplotlib",
    "mpmath", "numba", "numpy", "pandas", "picos", "plotly", "scipy", "scipy.integrate",
    "scipy.optimize", "scipy.signal", "scipy.sparse", "scipy.stats", "slycot", "sympy", "trimesh",
    "xarray",
)  # fmt: skip
START = {
    "import": "import robustpolish as rp; rp.__all__; dir(rp)",
    "help": "import sys; sys.argv = ['robustpolish', '--help']\n"
    "from robustpolish.app.cli.main import main\nmain(['--help'], standalone_mode=False)",
    "air_bearing": "import robustpolish as rp; rp.air_bearing()",
    "hinf_norm": "import robustpolish as rp; rp.hinf_norm",
    "hinf_norm, called": "import robustpolish as rp; rp.hinf_norm(rp.air_bearing().open_loop)",
    "output_feedback": "import robustpolish as rp; rp.output_feedback",
    "robust_stability": "import robustpolish as rp; rp.robust_stability",
    "diagnose": "import robustpolish as rp; rp.diagnose",
}


def start_up() -> Cases:
    """Yield which heavy packages are imported by what a user does first."""
    for name, program in START.items():
        yield name, partial(_imported, program)
    # for their times, which stand in timings.json
    yield "whole process: --version", lambda: python("-m", "robustpolish", "--version").strip()
    yield "whole process: --help", lambda: len(python("-m", "robustpolish", "--help")) > 0


def _imported(program: str) -> Any:
    end = "import sys; print(repr(sorted(sys.modules)))"
    printed = python("-c", f"{program}\n{end}").splitlines()[-1]
    modules = set(ast.literal_eval(printed))
    return {name: name in modules for name in HEAVY}
