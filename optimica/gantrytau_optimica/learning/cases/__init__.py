"""Ways to learn a motion, beside each other, as a file describes them."""
