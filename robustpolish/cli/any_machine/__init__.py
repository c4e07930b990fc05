"""Commands for any machine, which --model or --plant names instead of the polishing robot."""
