"""Learning control of robots: runs of a robot with its servos."""
