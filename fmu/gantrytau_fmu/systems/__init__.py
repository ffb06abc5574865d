"""Systems of FMUs: co-simulation and SSP."""
