"""What is wrong with an FMU: checks of its files, a trial of its binary, and a rerun of its reference results."""
