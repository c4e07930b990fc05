"""Lets the tests of this folder import its collections of plants."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
