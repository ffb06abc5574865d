"""A robot controller whose references others overwrite from sample to sample."""
