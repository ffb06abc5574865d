"""`gantrytau estimate`: parameters from measured data."""
