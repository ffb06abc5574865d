"""A problem as an optimal-control problem in states, algebraics and inputs."""
