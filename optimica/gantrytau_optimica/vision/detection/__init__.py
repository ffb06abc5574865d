"""A pattern in images: its corners, and the steps that lost others."""
