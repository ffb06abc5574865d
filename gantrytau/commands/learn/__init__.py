"""`gantrytau learn`."""
