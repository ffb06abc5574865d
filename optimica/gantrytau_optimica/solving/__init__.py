"""How a nonlinear program is solved."""
