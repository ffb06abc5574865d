"""Predictive control of components beside do-mpc and rockit, which get the same equations, horizon and method."""
