"""References, and runs of a rig that learns."""
