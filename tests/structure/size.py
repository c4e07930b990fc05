"""Count lines of code: ``python -m tests.structure.size [--lines N] [--files N] [--folders N]``.

A line of code has a token that is neither comment nor docstring. The exit code is 1 above a limit.
"""

import argparse
import ast
import statistics
import sys
import tokenize
from pathlib import Path

_NO_CODE = {
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENCODING,
    tokenize.ENDMARKER,
}


def lines_of_code(file: Path) -> int:
    """Return the number of lines of code in a Python file."""
    lines: set[int] = set()
    with file.open("rb") as handle:
        for token in tokenize.tokenize(handle.readline):
            if token.type not in _NO_CODE:
                lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(ast.parse(file.read_bytes())):
        documented = isinstance(
            node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef
        )
        if documented and ast.get_docstring(node) is not None:
            text = node.body[0]
            lines.difference_update(range(text.lineno, (text.end_lineno or text.lineno) + 1))
    return len(lines)


def size_of(package: Path) -> dict[str, int]:
    """Return the lines of code, files and folders of a package, and the lines of a median file."""
    sizes = {file: lines_of_code(file) for file in package.rglob("*.py")}
    return {
        "lines": sum(sizes.values()),
        "files": len(sizes),
        "folders": len({file.parent for file in sizes}),
        "median": statistics.median_high(sizes.values()),
    }


def main(arguments: list[str]) -> int:
    """Print the size, and return 1 if it is above a limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--package", type=Path, default=Path("robustpolish"))
    for name in ("lines", "files", "folders"):
        parser.add_argument(f"--{name}", type=int, default=sys.maxsize)
    asked = parser.parse_args(arguments)
    size = size_of(asked.package)
    print(", ".join(f"{name}: {count}" for name, count in size.items()))
    return int(any(size[name] > getattr(asked, name) for name in ("lines", "files", "folders")))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
