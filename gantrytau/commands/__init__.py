"""The commands of the command line that work on a model of the user's choice, one module each."""
