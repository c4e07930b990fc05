"""Run the examples of all docstrings of an installed package, with nothing but the package.

``python examples.py robustpolish``, outside the checkout; pytest may be missing.
"""

import doctest
import importlib
import inspect
import pkgutil
import sys
from pathlib import Path

OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def main(name):
    """Run the examples and return how many fail."""
    sys.path = [p for p in sys.path if p and Path(p).resolve() != Path(__file__).resolve().parent]
    package = importlib.import_module(name)
    print(f"{name} from {Path(package.__file__).parent}")
    finder, runner = doctest.DocTestFinder(), doctest.DocTestRunner(optionflags=OPTIONS)
    found = [package]
    for module in pkgutil.walk_packages(package.__path__, f"{name}."):
        if not module.name.endswith("__main__"):
            found.append(importlib.import_module(module.name))
    for module in found:
        for test in finder.find(module, module=inspect.getmodule(module)):
            runner.run(test)
    print(f"{runner.tries} examples of {len(found)} modules, {runner.failures} failed")
    return runner.failures


if __name__ == "__main__":
    sys.exit(bool(main(sys.argv[1])))
