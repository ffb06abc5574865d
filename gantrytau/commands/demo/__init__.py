"""`gantrytau demo`."""
