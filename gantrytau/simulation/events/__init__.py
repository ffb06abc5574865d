"""What happens at instants of a simulation: what is sampled, what switches, and when."""
