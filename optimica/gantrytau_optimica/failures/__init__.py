"""How a solve ended and why, in the model's words."""
