"""How far a calibration can be trusted: poses that were not fitted, the error of the tool, a verdict."""
