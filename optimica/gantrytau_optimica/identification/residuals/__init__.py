"""What is left of the forces of a robot, and what noise of positions does to it."""
