"""Runs one SLICOT synthesis routine. A program of its own: it imports nothing of the package.

It reads a pickled dictionary from its standard input and writes one to its standard output, so that
a routine that hangs or crashes takes nothing with it. Given the number of the process that
started it, which holds that input open, it ends when that does.
"""

import pickle
import sys


def main() -> None:
    """Read the problem, call the routine, write the controller."""
    import slycot

    task = pickle.load(sys.stdin.buffer)
    if __name__ == "__main__" and len(sys.argv) > 1:
        # It lies beside this file; the package imports for a second.
        from parent_watch import exit_with_parent

        exit_with_parent(int(sys.argv[1]), sys.stdin.fileno())
    n, m, outputs, controls, measurements = task["sizes"]
    A, B, C, D = task["matrices"]
    if task["routine"] == "SB10AD":
        found = slycot.sb10ad(n, m, outputs, controls, measurements, task["gamma"], A, B, C, D)
        gamma, Ak, Bk, Ck, Dk = found[0], *found[1:5]
    else:
        Ak, Bk, Ck, Dk = slycot.sb10hd(n, m, outputs, controls, measurements, A, B, C, D)[:4]
        gamma = None
    pickle.dump({"gamma": gamma, "controller": (Ak, Bk, Ck, Dk)}, sys.stdout.buffer)


if __name__ == "__main__":
    main()
