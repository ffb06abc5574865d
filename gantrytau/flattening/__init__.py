"""From instances to one flat list of variables and equations: `FlatModel`."""
