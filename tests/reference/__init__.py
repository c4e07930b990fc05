"""Answers of the package, frozen: what a change of its structure has to leave as it is."""

import os

# As the Makefile exports; before numpy is imported, or the bits depend on the number of threads.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
