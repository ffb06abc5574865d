"""A control problem on meshes becomes a nonlinear program."""
