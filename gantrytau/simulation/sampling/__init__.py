"""From sample to sample in compiled functions: an explicit method of order 8, hundreds of places in one call."""
