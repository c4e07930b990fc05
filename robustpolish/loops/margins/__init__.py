"""How much gain, phase and delay a loop bears: one signal at a time, and all at once."""
