"""What a simulation remembers of its motion, for delays."""
