"""Least squares that all fits share: step, blocks, rank, robust weights, covariance, and what they leave of their data."""
