"""What comes from outside over time: samples, random signals, test signals."""
