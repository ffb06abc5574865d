"""Least squares that all fits share: step, blocks, robust weights, covariance, and what they leave of their data."""
