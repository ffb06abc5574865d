"""How far errors of the actuators carry the tool."""
