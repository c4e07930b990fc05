"""List every strong word of messages and docs with the test that backs it: python -m tests.words.

`words.toml` names a test for each word and place; the longest place that fits counts. "All" and
"none" are read where they speak of what was searched for.
"""

import ast
import re
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
WORDS = {
    "exact": r"exact(ly)?(?! (one|if)\b)",
    "proven": r"proven|prove[sd]?|proofs?|certified|guarantees?|guaranteed",
    "confirmed": r"confirmed",
    "all": r"(all|every) (the )?(crossings?|roots?|peaks?|gaps?|solutions?)",
    "none": r"(nothing|none) is missing|none other|no other (root|crossing)",
    "optimal": r"optimal",
    "not attained": r"not attained",
}
PATTERN = re.compile(
    r"\b(?:" + "|".join(f"(?P<{w.replace(' ', '_')}>{p})" for w, p in WORDS.items()) + r")\b", re.I
)
TEXTS = ("docs/*.md", "README.md", "robustpolish/**/*.jinja", "robustpolish/**/*.toml")


def strings():
    """Return (file, line, text) of all texts that a user can read; changes of the past are not."""
    for path in sorted(ROOT.glob("robustpolish/**/*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                for i, line in enumerate(node.value.splitlines()):
                    yield path, node.lineno + i, line
    for path in sorted(p for pattern in TEXTS for p in ROOT.glob(pattern)):
        if path.name != "changelog.md":
            for i, line in enumerate(path.read_text().splitlines()):
                yield path, i + 1, line


def backing(table, word, place):
    """Return the test of the longest place that fits, or None."""
    fits = [row for row in table.get(word, {}).items() if place.startswith(row[0])]
    return max(fits, key=lambda row: len(row[0]), default=(None, None))[1]


def exists(test):
    """Say whether a test function of this name stands in this file."""
    path, _, name = test.partition("::")
    return (ROOT / path).exists() and f"def {name}(" in (ROOT / path).read_text()


def listed():
    """Return (word, place, line, text, test) of every strong word."""
    table = tomllib.loads((Path(__file__).parent / "words.toml").read_text())
    return [
        (word, place, line, text.strip(), backing(table, word, place))
        for path, line, text in strings()
        for found in PATTERN.finditer(text)
        for word in [found.lastgroup.replace("_", " ")]
        for place in [str(path.relative_to(ROOT))]
    ]


def main():
    """Print the list; the number of words without a test is the answer."""
    bare = 0
    for word, place, line, text, test in listed():
        good = test is not None and exists(test)
        bare += not good
        print(f"{place}:{line}: {word}: {test if good else f'NO TEST ({test})'}: {text[:80]}")
    print(f"{bare} without a test")
    return bare


if __name__ == "__main__":
    sys.exit(bool(main()))
