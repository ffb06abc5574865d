"""`gantrytau doctor`: whether an installation works."""
