"""What an optimum depends on: sensitivities, and trade-offs along a weight."""
