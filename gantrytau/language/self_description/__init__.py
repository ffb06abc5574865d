"""What models say of themselves, by name: rods of robots, shapes of components."""
