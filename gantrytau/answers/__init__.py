"""What a translated model answers: functions, diagnosis, linear systems, mechanisms, C."""
