"""`gantrytau calibrate`: from measured poses to parameters, and before that the plan of what to measure."""
