"""Files of robot cells: what a tape measure knows, read with units, checked, and made ready for a plan."""
