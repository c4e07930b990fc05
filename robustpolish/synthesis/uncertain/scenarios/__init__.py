"""Controllers by worst cases: descents on the machines that proofs and corners say are worst."""
