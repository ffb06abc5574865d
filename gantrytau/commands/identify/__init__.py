"""`gantrytau identify`: masses and friction of a robot from logs of its motion."""
