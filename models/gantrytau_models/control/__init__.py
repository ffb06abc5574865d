"""What drives and measures the robots: plants, references, controllers."""
