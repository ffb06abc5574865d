"""What `make bench` measures, and the hand-written programs it measures against."""
