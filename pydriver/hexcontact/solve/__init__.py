"""How a problem is solved: load steps on windows, choice of steps and lattices, restart, progress."""
