"""Lower bounds on Θ by semidefinite programming."""
