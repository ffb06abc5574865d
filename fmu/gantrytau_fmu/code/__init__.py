"""From a Dae to the C code and the variables of an FMU."""
