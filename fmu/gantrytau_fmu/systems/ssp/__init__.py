"""Systems of FMUs in one file: System Structure and Parameterization 1.0."""
